//! Tableaus of explicit methods, from which the derivatives of a whole step are computed:
//!
//! `k_i = f(t + c_i h, x + h sum_j a_ij k_j)`, and the next state is `x + h sum_i b_i k_i`.
//!
//! The semi-implicit method is an exception, because its positions use the new rates: see [`Tableau::follows`].

use super::{Dop853, Dopri5, EqualSteps, Euler, ExplicitAdaptive, ExplicitSteps, Method, MethodKind, Rk4, Scheme};

/// The coefficients of one step of an explicit method.
///
/// ```
/// use armlet_core::integrate::Method;
///
/// let rk4 = Method::Rk4.tableau().expect("an explicit method");
/// assert_eq!((rk4.c, rk4.b.len()), (vec![0.0, 0.5, 0.5, 1.0], 4));
/// assert!((rk4.b.iter().sum::<f64>() - 1.0).abs() < 1e-15);
/// assert!(Method::SemiImplicit.tableau().expect("explicit").follows && Method::Radau5.tableau().is_none());
/// ```
#[derive(Clone, Debug)]
pub struct Tableau {
    /// The instants `c_i` of the stages, as fractions of the step.
    pub c: Vec<f64>,
    /// The weights `a_ij` of earlier slopes in the argument of each stage, dimensionless, one list per stage.
    pub a: Vec<Vec<f64>>,
    /// The weights `b_i` of the slopes in the step, dimensionless, one per stage.
    pub b: Vec<f64>,
    /// Whether a position `x_p` is computed with its new rate `x_r`: `x_p += h x_r`.
    pub follows: bool,
}

impl Tableau {
    fn equal<C: EqualSteps>(follows: bool) -> Self {
        let row = |i: usize| (0..i).map(|j| if j + 1 == i { C::STAGES[i].part } else { 0.0 }).collect();
        Tableau {
            c: C::STAGES.iter().map(|stage| C::INSTANTS[stage.instant]).collect(),
            a: (0..C::STAGES.len()).map(row).collect(),
            b: C::STAGES.iter().map(|stage| stage.weight / C::DIVISOR).collect(),
            follows,
        }
    }

    /// The tableau with one more stage at the end of the step, which the error estimate of the method uses. Its weight `b` is zero.
    pub(crate) fn with_last_stage<C: Scheme>() -> Self {
        let mut tableau = Self::embedded::<C>();
        tableau.c.push(C::C[C::STAGES]);
        tableau.a.push(C::A[C::STAGES].to_vec());
        tableau.b.push(0.0);
        tableau
    }

    fn embedded<C: Scheme>() -> Self {
        let stages = C::A[..C::STAGES].iter().map(|row| row.to_vec()).collect();
        Tableau { c: C::C[..C::STAGES].to_vec(), a: stages, b: C::A[C::STAGES].to_vec(), follows: false }
    }
}

impl Method {
    /// Return the tableau of the method, or `None` for an implicit method.
    pub fn tableau(self) -> Option<Tableau> {
        match self.kind() {
            MethodKind::ExplicitSteps(ExplicitSteps::Euler) => Some(Tableau::equal::<Euler>(false)),
            MethodKind::ExplicitSteps(ExplicitSteps::SemiImplicit) => Some(Tableau::equal::<Euler>(true)),
            MethodKind::ExplicitSteps(ExplicitSteps::Rk4) => Some(Tableau::equal::<Rk4>(false)),
            MethodKind::ExplicitAdaptive(ExplicitAdaptive::Dopri5) => Some(Tableau::embedded::<Dopri5>()),
            MethodKind::ExplicitAdaptive(ExplicitAdaptive::Dop853) => Some(Tableau::embedded::<Dop853>()),
            MethodKind::ImplicitSteps(_) | MethodKind::ImplicitAdaptive(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tableaus_are_consistent() {
        let mut found = 0;
        for tableau in Method::ALL.iter().filter_map(|method| method.tableau()) {
            found += 1;
            assert_eq!((tableau.a.len(), tableau.c.len()), (tableau.b.len(), tableau.b.len()));
            assert!((tableau.b.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            for (i, (row, c)) in tableau.a.iter().zip(&tableau.c).enumerate() {
                assert!((row.iter().sum::<f64>() - c).abs() < 1e-13, "{i}");
            }
        }
        assert_eq!(found, 5);
    }
}
