//! Coulomb friction under adaptive methods: joints stick and slip at located instants.
//!
//! The torque `F sign(v)` jumps at `v = 0`. For a joint that comes to rest, the sign would change in every step. So the step size of an
//! adaptive method would decrease without limit. The set-valued torque, `|tau_f| <= F` at `v = 0`, has a solution. It is
//! the stick-slip friction whose static friction is `F`.

use super::Problem;
use crate::error::Result;
use crate::plant::PlantSpec;

impl<'a> Problem<'a> {
    /// Return the plants with the friction of their models as stick-slip friction, if an adaptive method requires it. Errors: those of
    /// [`PlantSpec::sticking`].
    pub(in crate::simulate) fn sticking_plants(&self) -> Result<Option<Vec<PlantSpec>>> {
        if !self.options.method.is_adaptive() || !self.plants.iter().any(|plant| plant.jumps()) {
            return Ok(None);
        }
        self.plants.iter().map(|plant| plant.sticking()).collect::<Result<Vec<PlantSpec>>>().map(Some)
    }

    /// Return this problem with other plants.
    pub(in crate::simulate) fn with_plants<'b>(self, plants: &'b [PlantSpec]) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem { plants: plants.iter().collect(), ..self }
    }
}
