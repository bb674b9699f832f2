//! From a law as its constructor returns it to [`LawSpec`], which runs take.

use super::*;

macro_rules! convert {
    ($($variant:ident($spec:ty))*) => {
        $(impl From<$spec> for LawSpec {
            fn from(law: $spec) -> Self {
                LawSpec::$variant(law)
            }
        })*
    };
}

convert! {
    Adaptive(AdaptiveSpec)
    ComputedTorque(ComputedTorqueSpec)
    PdGravity(PdGravitySpec)
    CartesianImpedance(CartesianImpedanceSpec)
    ElasticImpedance(ElasticImpedanceSpec)
    JointImpedance(JointImpedanceSpec)
    MotorPd(MotorPdSpec)
    StateFeedback(StateFeedbackSpec)
    PriorityVelocity(PriorityVelocitySpec)
    PriorityAcceleration(PriorityAccelerationSpec)
    External(ExternalSpec)
}
