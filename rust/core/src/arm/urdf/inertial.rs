//! The inertia of a link, from its `inertial` element.

use super::element::Reader;
use super::plausible::{INERTIA, MASS, negative_moment};
use crate::error::Result;
use crate::spatial::{Inertia, PARAMETERS, Sym3, Vector, Vector3};
use roxmltree::Node;

/// A violation of the triangle inequality by more than this fraction of the largest entry causes a warning.
const TRIANGLE: f64 = 1e-6;

impl Reader<'_> {
    pub fn inertial(&mut self, node: Node, link: &str) -> Result<Inertia<f64>> {
        let inertial = node;
        let [origin, mass, inertia] = self.children(node, ["origin", "mass", "inertia"])?;
        let placement = self.placement(origin)?;
        let Some(mass_node) = mass else { return Err(self.error(node, format!("link {link} has an inertial without mass"))) };
        let Some(mass) = self.number(mass_node, "value")? else { return Err(self.error(mass_node, "mass has no value")) };
        if mass < 0.0 {
            return Err(self.error(mass_node, format!("mass of link {link} is negative: got {mass}")));
        }
        self.plausible(mass_node, || format!("mass of link {link}"), MASS, &[mass])?;
        let Some(node) = inertia else { return Err(self.error(node, format!("link {link} has an inertial without inertia"))) };
        let entry = |name: &str, needed: bool| match self.number(node, name)? {
            Some(x) => Ok(x),
            None if needed => Err(self.error(node, format!("inertia of link {link} has no {name}"))),
            None => Ok(0.0),
        };
        let moments = Sym3([
            entry("ixx", true)?,
            entry("ixy", false)?,
            entry("iyy", true)?,
            entry("ixz", false)?,
            entry("iyz", false)?,
            entry("izz", true)?,
        ]);
        self.plausible(node, || format!("inertia of link {link}"), INERTIA, &moments.0)?;
        if mass == 0.0 {
            self.warn(node, format!("link {link} has zero mass"));
        }
        let largest = moments.0.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let principal = moments.principal();
        if let Some(worst) = negative_moment(&moments, mass, placement.translation) {
            return Err(self.error(node, format!("inertia of link {link} has a negative principal moment: got {worst:e}")));
        }
        if principal[2] > principal[0] + principal[1] + TRIANGLE * largest {
            let [a, b, c] = principal;
            self.warn(
                node,
                format!(
                    "inertia of link {link} is no rigid body's: principal moments {a:.4e}, {b:.4e}, {c:.4e} break the triangle inequality"
                ),
            );
        }
        // The file has the moments of inertia about the centre of mass, in axes rotated by rpy.
        let turned = Inertia { mass, moment: Vector3::zero(), inertia: moments };
        let mut inertia = turned.placed(&placement);
        let mut rounded = [0.0; PARAMETERS];
        inertia.write_parameters(&mut rounded);
        let distance = placement.translation.norm();
        let (moment, second) = (mass * distance, mass * distance * distance + largest);
        let scales = std::array::from_fn(|k| [mass, moment, second][usize::from(k > 0) + usize::from(k > 3)]);
        if let Some(exact) = self.exact(inertial, "parameters", rounded, scales, "mass and inertia")? {
            inertia = Inertia::from_parameters(&exact);
        }
        Ok(inertia)
    }
}
