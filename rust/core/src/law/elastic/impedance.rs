//! Cartesian impedance through elastic joints (Ott, Albu-Schaeffer, Kugi and Hirzinger 2008). The outer loop is an impedance law, which
//! computes `u`. The inner loop converts `u` into the motor torque
//!
//! `tau = (I - B B0^-1) K_J (theta - q) + B B0^-1 ( J'[K_m (x_d - x) + D_m (x_d_dot - J v)] + g(q) - D0 w )`
//!
//! with the motor positions `theta` and the joint stiffness `K_J`. `B` is the motor inertia, `B0` its reduced value, `D0` its damping, and
//! `w` the damped velocity of `inertia_reduction`. The prime is the transpose. Units are those of revolute joints. The options are the
//! options of the rigid law, except that `tau_max` limits the motor torque `tau`. An integral wrench `F_I` contributes `B B0^-1 J' F_I` to
//! `tau`.
//!
//! For a target at rest and without options, the storage function
//! `E = v'Mv/2 + (theta-q)'K_J(theta-q)/2 + theta_dot'B0 theta_dot/2 + e'K_m e/2`, with `e = x_d - x`, obeys the identity
//! `dE/dt = F.x_dot - theta_dot'D0 w - x_dot'D_m x_dot + (theta_dot - v).u`, where `F` is the external force. The last term has no
//! definite sign.

use crate::kinematics::Coordinates;
use crate::law::CartesianImpedanceSpec;
use crate::law::definition::{Definition, Shape};
use crate::law::equations::{Answer, Equations, Loop};
use crate::law::inertia_reduction::{ReductionSpec, described, reduced_facts};
use crate::plant::{Parameters, PlantSpec};

/// Cartesian impedance of an arm with elastic joints, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// # use armlet_core::plant::{ElasticSpec, PlantSpec};
/// use armlet_core::law::{CartesianImpedanceSpec, ElasticImpedanceSpec, Gain, ReductionSpec};
/// # let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// # let gain = |k: f64| Gain::scalar("gain", 2, k);
/// # let elastic = |stiffness| ElasticSpec::new(model.clone(), gain(stiffness)?, gain(0.2)?, None, None, None).map(PlantSpec::from);
///
/// let outer = CartesianImpedanceSpec::new(model.clone(), Motion::hold(vec![0.7, 0.2])?, gain(60.0)?, gain(12.0)?, "link2", "xy")?;
/// let inner = ReductionSpec::new(2, gain(2000.0)?, gain(0.2)?, gain(0.05)?, None, 0.7, false)?;
/// let law = ElasticImpedanceSpec { outer, inner };
/// // The storage function requires a plant with the stiffness of the law.
/// assert!(law.has_storage(&elastic(2000.0)?) && !law.has_storage(&elastic(1500.0)?));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticImpedanceSpec {
    /// The outer loop: the impedance law of the links.
    pub outer: CartesianImpedanceSpec,
    /// The inner loop: the reduction of motor inertia.
    pub inner: ReductionSpec,
}

impl ElasticImpedanceSpec {
    /// Whether the energy `E`, plus the energy of wall and stops, is a storage function on this plant.
    ///
    /// The plant must agree with the law's model, and have neither joint damping nor friction. The motor torque must have no limit. Rows of
    /// orientation are excluded, because there the rate of `e` is not `-J v`.
    pub fn has_storage(&self, plant: &PlantSpec) -> bool {
        !self.outer.coordinates.turns()
            && self.outer.options.tau_max.is_none()
            && described(plant, &self.outer.model, &self.inner).is_some()
    }
}

impl Definition for ElasticImpedanceSpec {
    reduced_facts!("ElasticImpedance");

    fn initial_state(&self) -> &[f64] {
        self.outer.initial_state()
    }

    fn coordinates(&self) -> Option<&Coordinates> {
        self.outer.coordinates()
    }
}

impl Shape for ElasticImpedanceSpec {
    fn same_shape(&self, other: &Self) -> bool {
        self.outer.same_shape(&other.outer) && self.inner.same_shape(&other.inner)
    }
}

impl Equations for ElasticImpedanceSpec {
    fn parameters(&self, period: Option<f64>) -> Parameters {
        self.outer.parameters(period).and(self.inner.parameters())
    }

    fn equations(&self, at: &Loop) -> Answer {
        let outer = self.outer.impedance(at);
        self.outer.name_target_dynamics(at, &outer.j);
        let inner = self.inner.torque(at, &outer.tau);
        let ratio = at.gain("inertia_ratio");
        let [tau, z_dot] = self.outer.options.limited(at, inner.tau, outer.z_dot, |wrench| ratio * &outer.j.tr_mul(wrench));
        let z_dot = self.outer.name_integral(at, z_dot);
        Answer { dissipation: -(inner.power + outer.power), ..Answer::with_rate(tau, z_dot) }
    }
}
