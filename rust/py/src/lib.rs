//! The extension module `armlet._core`. It converts arguments, calls the core, and maps errors and statuses. It contains no algorithm.
//!
//! The folder is flat, because each class or function of the extension has one file; a class with several files has a folder.

mod about;
mod arguments;
mod arm;
mod arrays;
mod batch_stepper;
mod broadcast;
mod constructor_call;
mod elastic;
mod errors;
mod event;
mod force;
mod friction;
mod gradient;
mod integrate;
mod interrupts;
mod inverse_kinematics;
mod law;
mod listed;
mod loops;
mod motion;
mod observer;
mod plan;
mod plant;
mod printed;
mod priority;
mod properties;
mod run_options;
mod samples;
mod seal;
mod simulate;
mod simulator;
mod simulator_state;
mod spline;
mod stops;
mod stored_array;
mod suggested_gains;
mod task;
mod warnings;
mod web;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    use super::*;
    use armlet_core::integrate::{Method, STIFF};
    use pyo3::types::PyTuple;

    #[pymodule_export]
    use super::about::{build_info, statuses};
    #[pymodule_export]
    use super::arm::{
        _restore_arm, _restore_planar_pr, _restore_tree, _urdf_joints, Arm, example_urdf, load_urdf, pendulum, planar_arm, planar_pr,
        project_parameters,
    };
    #[pymodule_export]
    use super::arrays::python::numbers;
    #[pymodule_export]
    use super::elastic::{damping_from_ratio, elastic_limits, equilibrium, smallest_reduced_inertia, stiffness_limit};
    #[pymodule_export]
    use super::gradient::{_adjoint, _adjoint_of_rows, _sensitivities, _sensitivities_of_rows};
    #[pymodule_export]
    use super::integrate::{Stepper, integrate};
    #[pymodule_export]
    use super::inverse_kinematics::{InverseKinematics, inverse_kinematics};
    #[pymodule_export]
    use super::law::{
        Adaptive, CartesianImpedance, ComputedTorque, ElasticImpedance, ElasticTracking, Guarded, JointImpedance, JointTracking, Law,
        MotorPD, PDGravity, PID, PriorityAcceleration, PriorityVelocity, StateFeedback,
    };
    #[pymodule_export]
    use super::listed::loop_program;
    #[pymodule_export]
    use super::motion::{BangBang, Hold, Motion, Quintic, Sinusoid, Table};
    #[pymodule_export]
    use super::observer::{_restore_observer, MomentumObserver};
    #[pymodule_export]
    use super::plan::_restore_plan;
    #[pymodule_export]
    use super::plan::bang_bang::bang_bang_time;
    #[pymodule_export]
    use super::plan::bang_bang_batch::BangBangBatch;
    #[pymodule_export]
    use super::plan::bang_bang_report::{BangBangReport, Bind};
    #[pymodule_export]
    use super::plan::profiles::{ProfileReport, minimum_jerk_time, trapezoid_time};
    #[pymodule_export]
    use super::plan::time_path::{_spline_slopes, time_path};
    #[pymodule_export]
    use super::plan::timed_path::{_restore_time_path, TimedPath};
    #[pymodule_export]
    use super::plan::torque::{Best, TorqueOptimum, torque_optimal_time};
    #[pymodule_export]
    use super::plant::{ElasticArm, Plant, RigidArm, VelocityArm, Wall};
    #[pymodule_export]
    use super::printed::{_c_of_arm, _c_of_law, _c_of_observer};
    #[pymodule_export]
    use super::priority::{
        _priority_reasons, _restore_arm_solver, ArmPrioritySolver, PrioritySolution, PrioritySolver, Within, diagnose_priority,
        solve_priority, velocity_bounds,
    };
    #[pymodule_export]
    use super::samples::_select_samples;
    #[pymodule_export]
    use super::seal::{_restore, _seal, _share};
    #[pymodule_export]
    use super::simulate::{simulate, simulate_batch};
    #[pymodule_export]
    use super::spline::Spline;
    #[pymodule_export]
    use super::stored_array::{_restore_array, _stored_array};

    #[pymodule_export]
    use super::batch_stepper::_BatchStepper;
    #[pymodule_export]
    use super::simulator::{_restore_simulator, Simulator};
    #[pymodule_export]
    use super::suggested_gains::{SuggestedGains, suggest_gains};
    #[pymodule_export]
    use super::task::Task;
    #[pymodule_export]
    use super::task::kinds::{AxisTask, CentreOfMassTask, DistanceTask, JointLimitTask, PostureTask, RelativeTask};
    #[pymodule_export]
    use super::web::{_wasm_of_operations, _web_loop};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // An instruction set that is requested but not available raises an error at import.
        armlet_core::scalar::instruction_set::isa_request().map_err(pyo3::exceptions::PyImportError::new_err)?;
        let names = |adaptive: bool| {
            let all = Method::ALL.iter().filter(move |method| method.is_adaptive() || !adaptive);
            all.map(|method| method.name()).chain([STIFF])
        };
        module.add("METHODS", PyTuple::new(module.py(), names(false).collect::<Vec<_>>())?)?;
        module.add("ADAPTIVE_METHODS", PyTuple::new(module.py(), names(true).collect::<Vec<_>>())?)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
