//! The numbers of a law or a plant that differ between runs. In the set-up of a recording they become inputs. Their names are those of
//! gradients and of listings, and the equations read them by these names.

use crate::dynamics::{AnyArm, At, Model};
use crate::linalg::gain::{AnyGain, Gain};
use crate::scalar::{Real, labelled_numbers};
use crate::trace::{E, M, V};
use std::any::Any;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

/// A gain in equations: `&k * &x`.
pub type K = AnyGain<E>;

/// The recorded numbers of a law or a plant, by name.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::law::Gain;
/// use armlet_core::plant::Parameters;
/// use armlet_core::trace::expression::vector;
/// use armlet_core::trace::function::recorded;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
///
/// let kp = Gain::scalar("kp", 1, 20.0)?;
/// // The torque kp q + g(q) of a pendulum, as a function of its angle q.
/// let set_up = || Parameters::of_arm(&model).gain("kp", &kp);
/// let torque = recorded(1, set_up, |numbers, q| {
///     let tau = numbers.get_gain("kp") * &vector(q) + numbers.arm_at(&vector(q)).unwrap().gravity();
///     tau.as_slice().to_vec()
/// });
/// let mut torque = torque.expect("the formula does not branch").interpreted(false);
/// torque.all_inputs().fill(0.3);
/// torque.run();
/// assert!((torque.output(0)[0] - (6.0 + 5.0 * 0.3f64.sin())).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Default)]
pub struct Parameters {
    /// The arm at its last configuration.
    arm: Option<RefCell<Rc<At<E>>>>,
    values: Vec<(&'static str, Value)>,
    inner: Option<Box<Parameters>>,
}

#[derive(Clone)]
enum Value {
    Number(E),
    Numbers(V),
    Matrix(M),
    Gains(Vec<K>),
    Made(Rc<dyn Any>),
}

impl Parameters {
    /// The inertial parameters of an arm.
    pub fn of_arm(model: &Model) -> Self {
        let arm = At::new(&Arc::new(AnyArm::new(model)), &vec![E::zero(); model.n()]);
        Parameters { arm: Some(RefCell::new(Rc::new(arm))), ..Parameters::default() }
    }

    fn with(mut self, name: &'static str, value: Value) -> Self {
        self.values.push((name, value));
        self
    }

    /// Add the number `x`.
    pub fn number(self, name: &'static str, x: f64) -> Self {
        let x = E::labelled(name, 0, || E::varying(x));
        self.with(name, Value::Number(x))
    }

    /// Add numbers, `(k,)`.
    pub fn numbers(self, name: &'static str, x: &[f64]) -> Self {
        let x = V::from_vec(labelled_numbers(name, x));
        self.with(name, Value::Numbers(x))
    }

    /// Add numbers that a loop has as constants unless their derivative is required, `(k,)`.
    pub fn fixed(self, name: &'static str, x: &[f64]) -> Self {
        let x = V::from_iterator(x.len(), x.iter().map(|&x| E::fixed(x)));
        self.with(name, Value::Numbers(x))
    }

    /// Add a matrix with `columns` columns, row-major.
    pub fn matrix(self, name: &'static str, columns: usize, x: &[f64]) -> Self {
        let x = M::from_row_slice(x.len() / columns, columns, &labelled_numbers(name, x));
        self.with(name, Value::Matrix(x))
    }

    /// Add a gain.
    pub fn gain(self, name: &'static str, gain: &Gain) -> Self {
        self.gains(name, [gain])
    }

    /// Add several gains of one name.
    pub fn gains<'g>(self, name: &'static str, gains: impl IntoIterator<Item = &'g Gain>) -> Self {
        let gains = gains.into_iter().map(|gain| K::labelled(name, gain)).collect();
        self.with(name, Value::Gains(gains))
    }

    /// Add what `add` adds for `x`, if there is an `x`.
    pub fn option<T>(self, x: Option<T>, add: impl FnOnce(Self, T) -> Self) -> Self {
        match x {
            Some(x) => add(self, x),
            None => self,
        }
    }

    /// Add a value that is made of recorded numbers.
    pub fn made<T: 'static>(self, name: &'static str, value: T) -> Self {
        self.with(name, Value::Made(Rc::new(value)))
    }

    /// The same numbers around an inner law with the numbers `inner`.
    pub fn around(self, inner: Parameters) -> Self {
        Parameters { inner: Some(Box::new(inner)), ..self }
    }

    /// Add the numbers of `other`.
    pub fn and(mut self, other: Parameters) -> Self {
        self.values.extend(other.values);
        self
    }

    fn get(&self, name: &str) -> &Value {
        let Some((_, value)) = self.values.iter().find(|(known, _)| *known == name) else {
            unreachable!("equations read only their parameters: {name}")
        };
        value
    }

    /// Whether there are numbers of this name.
    pub fn has(&self, name: &str) -> bool {
        self.values.iter().any(|(known, _)| *known == name)
    }

    /// The arm at the configuration `q`; `None` without an arm.
    pub fn arm_at(&self, q: &V) -> Option<Rc<At<E>>> {
        self.arm.as_ref().map(|arm| {
            let mut arm = arm.borrow_mut();
            match Rc::get_mut(&mut arm) {
                // The memory of the last configuration is free.
                Some(free) => free.move_to(q.as_slice()),
                None => *arm = Rc::new(arm.at(q)),
            }
            arm.clone()
        })
    }

    /// The parameters of an inner law.
    pub fn get_inner(&self) -> &Parameters {
        let Some(inner) = &self.inner else { unreachable!("a law around another one has its parameters") };
        inner
    }

    /// The number `name`.
    pub fn get_number(&self, name: &str) -> E {
        let Value::Number(x) = self.get(name) else { unreachable!("a number: {name}") };
        *x
    }

    /// The numbers `name`.
    pub fn get_numbers(&self, name: &str) -> &V {
        let Value::Numbers(x) = self.get(name) else { unreachable!("numbers: {name}") };
        x
    }

    /// The matrix `name`.
    pub fn get_matrix(&self, name: &str) -> &M {
        let Value::Matrix(x) = self.get(name) else { unreachable!("a matrix: {name}") };
        x
    }

    /// The gain `name`.
    pub fn get_gain(&self, name: &str) -> &K {
        &self.get_gains(name)[0]
    }

    /// The gains `name`.
    pub fn get_gains(&self, name: &str) -> &[K] {
        let Value::Gains(gains) = self.get(name) else { unreachable!("gains: {name}") };
        gains
    }

    /// The value `name` of [`Parameters::made`].
    pub fn get_made<T: 'static>(&self, name: &str) -> &T {
        let Value::Made(value) = self.get(name) else { unreachable!("a value of this type: {name}") };
        let Some(value) = value.downcast_ref() else { unreachable!("a value of this type: {name}") };
        value
    }
}
