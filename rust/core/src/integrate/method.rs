//! The table of integration methods by name. Callers distinguish only the four kinds of methods.

use super::{
    Accuracy, Differentiable, Dop853, Dopri5, Embedded, EqualSteps, Euler, Explicit, Radau5, Rk4, Rodas4, Ros2, SemiImplicit, System,
    WithAdaptive, WithExplicitSteps, WithScheme, WithSteps, semi_implicit,
};
use crate::error::{Error, Result};
use crate::scalar::Real;

/// Defines the methods with their names in Python, for each kind.
macro_rules! methods {
    ($($(#[$doc:meta])* $kind:ident { $($(#[$text:meta])* $method:ident $name:literal,)* })*) => {
        /// The numerical method of a run.
        ///
        /// ```
        /// use armlet_core::integrate::Method;
        ///
        /// let method = Method::from_name("rodas4", false)?;
        /// assert!(method.is_adaptive() && method.is_implicit() && method.is_rosenbrock());
        /// assert_eq!(Method::Rk4.evaluations_per_step(), Some(4));
        /// assert_eq!(Method::ALL.iter().filter(|method| !method.is_adaptive()).count(), 4);
        /// assert!(Method::from_name("ode45", false).is_err());
        /// # Ok::<(), armlet_core::error::Error>(())
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Method {
            $($($(#[$text])* $method,)*)*
        }

        /// The kind of a method: explicit or implicit, with fixed or adaptive steps.
        ///
        /// ```
        /// use armlet_core::integrate::{ExplicitSteps, Method, MethodKind};
        ///
        /// // A match on four kinds, instead of eight methods.
        /// let per_step = |method: Method| match method.kind() {
        ///     MethodKind::ExplicitSteps(method) => Some(method.evaluations()),
        ///     MethodKind::ImplicitSteps(method) => Some(method.evaluations()),
        ///     MethodKind::ExplicitAdaptive(_) | MethodKind::ImplicitAdaptive(_) => None,
        /// };
        /// assert_eq!(Method::Euler.kind(), MethodKind::ExplicitSteps(ExplicitSteps::Euler));
        /// assert_eq!([Method::Euler, Method::Rk4, Method::Dopri5].map(per_step), [Some(1), Some(4), None]);
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum MethodKind {
            $($(#[$doc])* $kind($kind),)*
        }

        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug, PartialEq, Eq)]
            pub enum $kind {
                $($(#[$text])* $method,)*
            }
        )*

        impl Method {
            /// All methods.
            pub const ALL: &'static [Method] = &[$($(Method::$method,)*)*];

            /// The name of the method in Python.
            pub fn name(self) -> &'static str {
                match self {
                    $($(Method::$method => $name,)*)*
                }
            }

            /// The kind of the method.
            pub fn kind(self) -> MethodKind {
                match self {
                    $($(Method::$method => MethodKind::$kind($kind::$method),)*)*
                }
            }
        }
    };
}

methods! {
    /// Explicit, with steps of fixed size.
    ExplicitSteps {
        /// Explicit Euler, order 1.
        Euler "euler",
        /// Semi-implicit Euler, order 1.
        SemiImplicit "semi_implicit",
        /// The classical Runge-Kutta method, order 4.
        Rk4 "rk4",
    }
    /// Implicit, with steps of fixed size.
    ImplicitSteps {
        /// An L-stable Rosenbrock method of order 2.
        Ros2 "ros2",
    }
    /// Explicit, with adaptive steps.
    ExplicitAdaptive {
        /// Dormand and Prince, order 5.
        Dopri5 "dopri5",
        /// Dormand and Prince, order 8.
        Dop853 "dop853",
    }
    /// Implicit, with adaptive steps.
    ImplicitAdaptive {
        /// Radau IIA, order 5.
        Radau5 "radau5",
        /// A Rosenbrock method of order 4.
        Rodas4 "rodas4",
    }
}

/// The name in Python that selects an implicit method with adaptive steps: [`Method::for_stiff`].
pub const STIFF: &str = "stiff";

impl Method {
    /// Return the implicit method with adaptive steps that takes the least time for a stiff system. `sampled`: whether a controller
    /// holds its output between samples. Then the method starts anew at each sample, and `rodas4` needs fewer evaluations and matrix
    /// decompositions for a start.
    ///
    /// ```
    /// use armlet_core::integrate::Method;
    ///
    /// assert_eq!(Method::from_name("stiff", false)?, Method::Radau5);
    /// assert_eq!(Method::from_name("stiff", true)?, Method::for_stiff(true));
    /// assert_eq!(Method::for_stiff(true), Method::Rodas4);
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn for_stiff(sampled: bool) -> Self {
        if sampled { Method::Rodas4 } else { Method::Radau5 }
    }

    /// Return the method that a name in Python selects. `"stiff"` selects [`Method::for_stiff`], where `sampled` matters. Errors:
    /// [`Error::Unknown`] for an unknown name.
    pub fn from_name(name: &str, sampled: bool) -> Result<Self> {
        if name == STIFF {
            return Ok(Method::for_stiff(sampled));
        }
        let found = Self::ALL.iter().copied().find(|method| method.name() == name);
        found.ok_or_else(|| Error::unknown("method", "", Self::ALL.iter().map(|method| method.name()).chain([STIFF]), name))
    }

    /// Whether the method chooses its step sizes.
    pub fn is_adaptive(self) -> bool {
        match self.kind() {
            MethodKind::ExplicitSteps(_) | MethodKind::ImplicitSteps(_) => false,
            MethodKind::ExplicitAdaptive(_) | MethodKind::ImplicitAdaptive(_) => true,
        }
    }

    /// Whether the method needs the derivatives of the system.
    pub fn is_implicit(self) -> bool {
        match self.kind() {
            MethodKind::ExplicitSteps(_) | MethodKind::ExplicitAdaptive(_) => false,
            MethodKind::ImplicitSteps(_) | MethodKind::ImplicitAdaptive(_) => true,
        }
    }

    /// The number of evaluations of the right-hand side per step, for a method of fixed steps. `None` for an adaptive method.
    pub fn evaluations_per_step(self) -> Option<u64> {
        match self.kind() {
            MethodKind::ExplicitSteps(method) => Some(method.evaluations()),
            MethodKind::ImplicitSteps(method) => Some(method.evaluations()),
            MethodKind::ExplicitAdaptive(_) | MethodKind::ImplicitAdaptive(_) => None,
        }
    }

    /// Whether the method is a Rosenbrock method, which is implicit and solves only linear equations. It also requires `df/dt`, unless the
    /// input is constant.
    pub fn is_rosenbrock(self) -> bool {
        match self.kind() {
            MethodKind::ExplicitSteps(_) | MethodKind::ExplicitAdaptive(_) | MethodKind::ImplicitAdaptive(ImplicitAdaptive::Radau5) => {
                false
            }
            MethodKind::ImplicitSteps(ImplicitSteps::Ros2) | MethodKind::ImplicitAdaptive(ImplicitAdaptive::Rodas4) => true,
        }
    }

    /// Whether the method has its order only with exact derivatives. The order of `radau5` does not depend on them, because it iterates.
    /// The method `ros2` has order 2 with any matrix.
    pub fn needs_exact_derivatives(self) -> bool {
        match self.kind() {
            MethodKind::ExplicitSteps(_) | MethodKind::ExplicitAdaptive(_) => false,
            MethodKind::ImplicitSteps(ImplicitSteps::Ros2) | MethodKind::ImplicitAdaptive(ImplicitAdaptive::Radau5) => false,
            MethodKind::ImplicitAdaptive(ImplicitAdaptive::Rodas4) => true,
        }
    }
}

/// ```
/// use armlet_core::integrate::ExplicitSteps;
///
/// assert_eq!(ExplicitSteps::Rk4.instants(), [0.0, 0.5, 1.0]);
/// assert_eq!([ExplicitSteps::Euler, ExplicitSteps::SemiImplicit, ExplicitSteps::Rk4].map(|method| method.evaluations()), [1, 1, 4]);
/// ```
impl ExplicitSteps {
    /// The times of the inputs, as increasing fractions of the step.
    pub fn instants(self) -> &'static [f64] {
        match self {
            ExplicitSteps::Euler => Euler::INSTANTS,
            ExplicitSteps::SemiImplicit => semi_implicit::INSTANTS,
            ExplicitSteps::Rk4 => Rk4::INSTANTS,
        }
    }

    /// The number of evaluations of the right-hand side per step.
    pub fn evaluations(self) -> u64 {
        match self {
            ExplicitSteps::Euler => Euler::STAGES.len() as u64,
            ExplicitSteps::SemiImplicit => 1,
            ExplicitSteps::Rk4 => Rk4::STAGES.len() as u64,
        }
    }

    /// Run `task` with this method, from the state `x` of `system`. `u` is memory for an input. Errors: [`Error::Input`] if the method is
    /// `semi_implicit` and the system has no pairs of positions and rates.
    pub fn apply<S, F, T>(self, system: F, x: Vec<S>, u: F::Input, task: T) -> Result<T::Output>
    where
        S: Real,
        F: System<S, Input: Send + Sync + 'static>,
        T: WithExplicitSteps<S, F>,
    {
        let state = x.clone();
        Ok(match self {
            ExplicitSteps::Euler => task.with_explicit(system, x, Explicit::<Euler, _, _>::new(state, u)),
            ExplicitSteps::SemiImplicit => {
                let method = SemiImplicit::new(&system, state, u)?;
                task.with_explicit(system, x, method)
            }
            ExplicitSteps::Rk4 => task.with_explicit(system, x, Explicit::<Rk4, _, _>::new(state, u)),
        })
    }
}

/// ```
/// use armlet_core::integrate::{ImplicitSteps, Method, MethodKind};
///
/// let MethodKind::ImplicitSteps(method) = Method::Ros2.kind() else { panic!() };
/// assert_eq!((method, method.evaluations()), (ImplicitSteps::Ros2, 2));
/// ```
impl ImplicitSteps {
    /// The number of evaluations of the right-hand side per step.
    pub fn evaluations(self) -> u64 {
        match self {
            ImplicitSteps::Ros2 => 2,
        }
    }

    /// Run `task` with this method, from the state `x` of `system`. `u` is memory for an input.
    pub fn apply<F, T>(self, system: F, x: Vec<f64>, u: F::Input, task: T) -> T::Output
    where
        F: Differentiable<f64, Input: Send + Sync + 'static>,
        T: WithSteps<f64, F>,
    {
        let n = x.len();
        match self {
            ImplicitSteps::Ros2 => {
                let method = Ros2::new(x.clone(), vec![0.0; n * n], vec![0usize; n], u);
                task.with(system, x, method)
            }
        }
    }
}

/// ```
/// use armlet_core::integrate::{ExplicitAdaptive, Method, MethodKind};
///
/// assert_eq!(Method::Dop853.kind(), MethodKind::ExplicitAdaptive(ExplicitAdaptive::Dop853));
/// assert!(Method::Dop853.is_adaptive() && !Method::Dop853.is_implicit());
/// ```
impl ExplicitAdaptive {
    /// Run `task` with this method, from the state `x` of `system`. `u` is memory for an input.
    pub fn apply<S, F, A, T>(self, system: F, accuracy: A, x: Vec<S>, u: F::Input, task: T) -> T::Output
    where
        S: Real,
        F: System<S, Input: Send + Sync + 'static>,
        A: Accuracy + Send + Sync + 'static,
        T: WithAdaptive<S, F>,
    {
        match self {
            ExplicitAdaptive::Dopri5 => task.with(system, Embedded::<Dopri5, _, _, _>::new(accuracy, x, u)),
            ExplicitAdaptive::Dop853 => task.with(system, Embedded::<Dop853, _, _, _>::new(accuracy, x, u)),
        }
    }

    /// Run `task` with the tableau of this method.
    pub fn scheme<T: WithScheme>(self, task: T) -> T::Output {
        match self {
            ExplicitAdaptive::Dopri5 => task.with::<Dopri5>(),
            ExplicitAdaptive::Dop853 => task.with::<Dop853>(),
        }
    }
}

/// ```
/// use armlet_core::integrate::{ImplicitAdaptive, Method, MethodKind};
///
/// assert_eq!(Method::Radau5.kind(), MethodKind::ImplicitAdaptive(ImplicitAdaptive::Radau5));
/// assert!(Method::Radau5.is_implicit() && !Method::Radau5.needs_exact_derivatives());
/// ```
impl ImplicitAdaptive {
    /// Run `task` with this method, from the state `x` of `system`. `u` is memory for an input.
    pub fn apply<F, A, T>(self, system: F, accuracy: A, x: Vec<f64>, u: F::Input, task: T) -> T::Output
    where
        F: Differentiable<f64, Input: Send + Sync + 'static>,
        A: Accuracy + Send + Sync + 'static,
        T: WithAdaptive<f64, F>,
    {
        let n = x.len();
        match self {
            ImplicitAdaptive::Radau5 => task.with(system, Radau5::new(accuracy, x, u)),
            ImplicitAdaptive::Rodas4 => task.with(system, Rodas4::new(accuracy, x, vec![0.0; n * n], vec![0usize; n], u)),
        }
    }
}
