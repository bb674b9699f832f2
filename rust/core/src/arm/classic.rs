//! Arms from textbooks: Denavit-Hartenberg rows, planar arms and the pendulum.
//!
//! Standard convention: `T_i = Rz(theta) Tz(d) Tx(a) Rx(alpha)`. Modified convention (Craig): `T_i = Rx(alpha) Tx(a) Rz(theta) Tz(d)`.
//! The coordinate `q` is added to `theta` of a revolute joint, and to `d` of a prismatic joint.

use super::build::require_memory;
use super::{Arm, ChainJoint, Frame, Joint, JointKind, JointType};
use crate::error::{Error, Result, finite};
use crate::interrupt;
use crate::memory;
use crate::spatial::{Inertia, Matrix3, Placement, RotationMatrix, Vector3};

/// The convention of Denavit-Hartenberg rows.
///
/// ```
/// use armlet_core::arm::{Arm, Convention, DhRow, JointKind};
/// use armlet_core::dynamics::Evaluator;
/// use nalgebra::dvector;
/// use std::f64::consts::FRAC_PI_2;
///
/// let row = DhRow { kind: JointKind::Revolute, a: 1.0, alpha: 0.0, d: 0.0, theta: 0.0, phi: [0.0; 10] };
/// let frame = |convention| Evaluator::new(&Arm::from_dh(&[row.clone()], convention, [0.0; 3])?).pose(&dvector![FRAC_PI_2], 0);
/// // In the standard convention, the joint moves the link of length `a`. In the modified convention, the joint is at the end of this link.
/// assert!((frame(Convention::Standard)?.translation.y - 1.0).abs() < 1e-15);
/// assert!((frame(Convention::Modified)?.translation.x - 1.0).abs() < 1e-15);
/// assert_eq!(Convention::parse("modified")?, Convention::Modified);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Convention {
    /// The joint axis is `z` of the previous frame.
    Standard,
    /// The joint axis is `z` of the frame of the joint (Craig).
    Modified,
}

impl Convention {
    /// Return the convention with the name `"standard"` or `"modified"`. Errors: `Unknown` for other names.
    pub fn parse(name: &str) -> Result<Convention> {
        match name {
            "standard" => Ok(Convention::Standard),
            "modified" => Ok(Convention::Modified),
            _ => Err(Error::unknown("convention", "", ["standard", "modified"], name)),
        }
    }
}

/// One Denavit-Hartenberg row: a joint and its body.
///
/// ```
/// use armlet_core::arm::{Arm, Convention, DhRow, JointKind, STANDARD_GRAVITY};
/// # use armlet_core::dynamics::Evaluator;
/// # use nalgebra::{dvector, vector};
/// use std::f64::consts::FRAC_PI_2;
///
/// // A column that turns, and an arm that slides out of it.
/// let row = |kind, alpha, d| DhRow { kind, a: 0.0, alpha, d, theta: 0.0, phi: [0.0; 10] };
/// let rows = [row(JointKind::Revolute, FRAC_PI_2, 0.8), row(JointKind::Prismatic, 0.0, 0.3)];
/// let arm = Arm::from_dh(&rows, Convention::Standard, STANDARD_GRAVITY)?;
/// let hand = Evaluator::new(&arm).pose(&dvector![0.0, 0.1], arm.frame_index("link2")?)?;
/// assert!((hand.translation.vector - vector![0.0, -0.4, 0.8]).norm() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct DhRow {
    /// Type of the joint.
    pub kind: JointKind,
    /// Length `a`, m.
    pub a: f64,
    /// Twist `alpha`, rad.
    pub alpha: f64,
    /// Offset `d`, m. For a prismatic joint, `q` is added.
    pub d: f64,
    /// Angle `theta`, rad. For a revolute joint, `q` is added.
    pub theta: f64,
    /// The ten inertial parameters of the body in Denavit-Hartenberg frame `i`, in the order of [`crate::spatial`]. SI units.
    pub phi: [f64; 10],
}

impl Arm {
    /// Return an arm from Denavit-Hartenberg rows. `gravity`: world axes, m/s^2. The frames `"link1"`, .. are the Denavit-Hartenberg
    /// frames. In the standard convention, such a frame is at the far end of its link. The `parameters` of the arm then refer to another
    /// frame of the link. Its origin is on the joint, and its z axis is the joint axis. Errors: `Input` for no rows or numbers that are not
    /// finite, `Memory`.
    pub fn from_dh(rows: &[DhRow], convention: Convention, gravity: [f64; 3]) -> Result<Arm> {
        finite("gravity", &gravity)?;
        if rows.is_empty() {
            return Err(Error::input("rows", "is empty: expected at least one row, got none"));
        }
        require_memory(rows.len())?;
        let mut arm = Arm { name: "dh".into(), joints: Vec::new(), mimics: Vec::new(), frames: Vec::new(), gravity, report: Vec::new() };
        let mut before = Placement::IDENTITY;
        for (i, row) in rows.iter().enumerate() {
            for (what, value) in [("a", row.a), ("alpha", row.alpha), ("d", row.d), ("theta", row.theta)] {
                finite(&format!("rows[{i}].{what}"), &[value])?;
            }
            finite(&format!("rows[{i}].phi"), &row.phi)?;
            let along_x = Placement::from_rpy([row.alpha, 0.0, 0.0], [row.a, 0.0, 0.0]);
            let turn = Placement::from_rpy([0.0, 0.0, row.theta], [0.0; 3]);
            let slide = Placement { rotation: Matrix3::IDENTITY, translation: Vector3::from([0.0, 0.0, row.d]) };
            // The rotation by `theta` is about the joint axis z, and the translation by `d` is along z. So both commute with the motion of
            // the joint.
            let (placement, frame) = match convention {
                Convention::Standard => (before.then(&turn).then(&slide), along_x),
                Convention::Modified => (before.then(&along_x).then(&turn).then(&slide), Placement::IDENTITY),
            };
            let name = format!("joint{}", i + 1);
            let mut joint = Joint::new(name, row.kind, i.checked_sub(1), placement, [0.0, 0.0, 1.0]);
            Inertia::from_parameters(&row.phi).placed(&frame).write_parameters(&mut joint.parameters);
            arm.joints.push(joint);
            let fixed = (convention == Convention::Standard).then(|| format!("link{}_fixed", i + 1));
            arm.frames.push(Frame { name: format!("link{}", i + 1), body: Some(i), placement: frame, joint: fixed });
            before = frame;
        }
        Ok(arm)
    }

    /// Return a planar arm in the x-y plane with axes along z. `q1` is measured from the x axis. The frames `"link1"`, .. are at the tips
    /// of the links.
    ///
    /// `lengths`: m. `masses`: kg. `coms`: distances of the centres of mass from the joints, along the links, m. `inertias`: about the
    /// centres of mass, kg m^2. `gravity`: x and y components, m/s^2. By default a link is a uniform rod, with 1 kg/m. Lengths, masses and
    /// inertias are not negative. Errors: `WrongShape` for lists of different lengths, `Input` for other faults, `Memory`.
    pub fn planar(
        lengths: &[f64],
        masses: Option<&[f64]>,
        coms: Option<&[f64]>,
        inertias: Option<&[f64]>,
        gravity: [f64; 2],
    ) -> Result<Arm> {
        require_memory(lengths.len())?;
        for (what, values) in [("lengths", Some(lengths)), ("masses", masses), ("coms", coms), ("inertias", inertias)] {
            let Some(values) = values else { continue };
            if values.len() != lengths.len() {
                return Err(Error::wrong(what, "length", format!("{} (one per link)", lengths.len()), values.len()));
            }
            finite(what, values)?;
            // A link of length zero is allowed. Two axes then coincide.
            if let (Some(k), true) = (values.iter().position(|&x| x < 0.0), what != "coms") {
                return Err(Error::input(what, format!("is negative: expected >= 0, got {}", values[k])).at([k]));
            }
        }
        if lengths.is_empty() {
            return Err(Error::input("lengths", "is empty: expected at least one link, got none"));
        }
        finite("gravity", &gravity)?;
        let given = |list: Option<&[f64]>, i: usize, otherwise: f64| list.map_or(otherwise, |list| list[i]);
        let mut list = memory::reserved(lengths.len())?;
        for (i, &length) in lengths.iter().enumerate() {
            interrupt::check();
            let mass = given(masses, i, length);
            let com = given(coms, i, 0.5 * length);
            let inertia = given(inertias, i, mass * length * length / 12.0);
            let at_joint = inertia + mass * com * com;
            // The link is thin in y and z. So the moment of inertia about x is zero, and the moments about y and z are equal.
            let phi = [mass, mass * com, 0.0, 0.0, 0.0, 0.0, at_joint, 0.0, 0.0, at_joint];
            let xyz = if i == 0 { [0.0; 3] } else { [lengths[i - 1], 0.0, 0.0] };
            list.push(ChainJoint::new(JointType::Moving(JointKind::Revolute), [0.0, 0.0, 1.0], [0.0; 3], xyz, phi));
        }
        let mut arm = Arm::from_chain(&list, [gravity[0], gravity[1], 0.0])?;
        for (frame, &length) in arm.frames.iter_mut().zip(lengths) {
            interrupt::check();
            frame.placement.translation = Vector3::from([length, 0.0, 0.0]);
            frame.joint = Some(format!("{}_fixed", frame.name));
        }
        arm.name = "planar".into();
        Ok(arm)
    }

    /// Return the pendulum `I a + G sin(theta) = tau`, where theta is measured from the downward vertical.
    ///
    /// `inertia`: `I`, kg m^2. `gravity_moment`: `G`, N m. The pendulum is a point mass `G^2 / (I g0^2)` at the distance `I g0 / G`. It
    /// moves in the x-y plane, with the gravity `g0 = 9.81` m/s^2 along -y. Errors: `Input` if `inertia` is not positive, or if a number is
    /// not finite.
    pub fn pendulum(inertia: f64, gravity_moment: f64) -> Result<Arm> {
        crate::error::positive("inertia", inertia)?;
        finite("gravity_moment", &[gravity_moment])?;
        const G0: f64 = 9.81;
        let moment = gravity_moment / G0;
        let mass = moment * moment / inertia;
        let phi = [mass, moment, 0.0, 0.0, 0.0, 0.0, inertia, 0.0, 0.0, inertia];
        let down = [0.0, 0.0, -std::f64::consts::FRAC_PI_2];
        let joint = ChainJoint::new(JointType::Moving(JointKind::Revolute), [0.0, 0.0, 1.0], down, [0.0; 3], phi);
        Ok(Arm { name: "pendulum".into(), ..Arm::from_chain(&[joint], [0.0, -G0, 0.0])? })
    }
}
