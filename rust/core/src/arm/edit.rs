//! Arms made from other arms: payloads, tool frames, locked joints, sub-chains.

use super::mimic::Leader;
use super::urdf::negative_moment;
use super::{Arm, Frame, Mimic, writable};
use crate::error::{Error, Result, finite, listed};
use crate::spatial::{Inertia, Matrix, Placement, Sym3, Vector, Vector3};

impl Arm {
    /// Return the arm with an additional frame `name`. `rpy`, rad, and `xyz`, m, are its placement in the frame `parent`. Errors:
    /// `Unknown` for `parent`, `Input` for a name that exists or numbers that are not finite.
    pub fn with_frame(&self, name: &str, parent: &str, rpy: [f64; 3], xyz: [f64; 3]) -> Result<Arm> {
        finite("rpy", &rpy)?;
        finite("xyz", &xyz)?;
        writable("name", name)?;
        let at = self.frames[self.frame_index(parent).map_err(|error| error.of_argument("parent"))?].clone();
        if self.frame_names().any(|known| known == name) {
            return Err(Error::input("name", format!("is taken: expected a new frame name, got {name}")));
        }
        let mut arm = self.clone();
        let placement = at.placement.then(&Placement::from_rpy(rpy, xyz));
        arm.frames.push(Frame { name: name.into(), body: at.body, placement, joint: Some(format!("{name}_fixed")) });
        Ok(arm)
    }

    /// Return the arm with a body fixed to `frame`. `mass`: kg. `com`: centre of mass relative to the origin of the frame, m. `inertia`:
    /// about the centre of mass, kg m^2. `com` and `inertia` are in the axes of the frame. A payload on the base has no effect.
    /// Errors: `Unknown` for the frame, `Input` for numbers that are not finite or a negative mass. Also `Input` for an inertia that is not
    /// symmetric or has a negative principal moment.
    pub fn with_payload(&self, frame: &str, mass: f64, com: [f64; 3], inertia: [[f64; 3]; 3]) -> Result<Arm> {
        finite("mass", &[mass])?;
        if mass < 0.0 {
            return Err(Error::input("mass", format!("is negative: expected a mass >= 0 in kg, got {mass}")));
        }
        finite("com", &com)?;
        finite("inertia", inertia.as_flattened())?;
        let largest = inertia.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            if (inertia[i][j] - inertia[j][i]).abs() > 1e-12 * largest {
                let (a, b) = (inertia[i][j], inertia[j][i]);
                return Err(Error::input("inertia", format!("is not symmetric: expected equal entries, got {a} and {b}")).at([i, j]));
            }
        }
        let at = self.frames[self.frame_index(frame)?].clone();
        let moments = Sym3([inertia[0][0], inertia[1][0], inertia[1][1], inertia[2][0], inertia[2][1], inertia[2][2]]);
        if let Some(worst) = negative_moment(&moments, mass, Vector3::from(com)) {
            return Err(Error::input("inertia", format!("has a negative principal moment: expected >= 0, got {worst:e}")));
        }
        let mut arm = self.clone();
        arm.merge(at.body, &Inertia::about_com(mass, Vector3::from(com), moments), &at.placement);
        Ok(arm)
    }

    /// Return the arm with joints locked at positions, rad or m. These joints are removed from `q`, and their bodies are merged with their
    /// parents. Mimic joints that follow a locked joint are locked too. Errors: `Unknown` for a name, `Input` for a position that is not
    /// finite.
    pub fn locked(&self, joints: &[(&str, f64)]) -> Result<Arm> {
        let (mut held, indices) = (vec![None; self.joints.len()], self.independent_indices());
        for (name, value) in joints {
            finite(&format!("joints[{name}]"), &[*value])?;
            held[indices[self.joint_index(name)?]] = Some(*value);
        }
        for mimic in &self.mimics {
            held[mimic.joint] = held[mimic.leader].map(|x| mimic.multiplier * x + mimic.offset);
        }
        let mut arm = Arm { joints: Vec::new(), frames: Vec::new(), mimics: Vec::new(), ..self.clone() };
        // For each old body: the body of the new arm that contains it, and its placement in this body.
        let mut moved: Vec<(Option<usize>, Placement)> = Vec::with_capacity(self.joints.len());
        let mut index = vec![None; self.joints.len()];
        for (i, (joint, held)) in self.joints.iter().zip(held).enumerate() {
            let (body, place) = joint.parent.map_or((None, Placement::IDENTITY), |p| moved[p]);
            let placement = place.then(&joint.placement);
            let Some(value) = held else {
                index[i] = Some(arm.joints.len());
                moved.push((index[i], Placement::IDENTITY));
                arm.joints.push(super::Joint { parent: body, placement, ..joint.clone() });
                continue;
            };
            let motion = joint.kind.displacement(joint.axis, value);
            let place = placement.then(&motion);
            moved.push((body, place));
            arm.merge(body, &Inertia::from_parameters(&joint.parameters), &place);
            arm.report.push(format!("locked: joint {} at {value}", joint.name));
        }
        for frame in &self.frames {
            let (body, place) = frame.body.map_or((None, Placement::IDENTITY), |b| moved[b]);
            let locked = frame.body.is_some_and(|b| moved[b].0.is_none() || moved[b].1 != Placement::IDENTITY);
            // A locked joint becomes a fixed joint with the same name. It connects the frame to the body that now contains it.
            let name = frame.body.filter(|_| locked && frame.joint.is_none()).map(|b| self.joints[b].name.clone());
            arm.frames.push(Frame { body, placement: place.then(&frame.placement), joint: name.or(frame.joint.clone()), ..frame.clone() });
        }
        self.mimics_of(&mut arm, |i| index[i])?;
        Ok(arm)
    }

    /// Return the part of the arm between two frames. The frame `root` becomes the fixed base and the world frame. Gravity keeps its
    /// direction relative to the arm's base, with all joints between this base and `root` at zero. With `tip`, only the joints that move
    /// `tip` relative to `root` remain. Errors: `Unknown` for a frame, `Input` if `tip` is not below `root`.
    pub fn sub_chain(&self, root: Option<&str>, tip: Option<&str>) -> Result<Arm> {
        let find = |argument: &str, name: Option<&str>| {
            name.map(|name| self.frame_index(name).map_err(|error| error.of_argument(argument))).transpose()
        };
        let (root, tip) = (find("root", root)?, find("tip", tip)?);
        let base = root.and_then(|f| self.frames[f].body);
        let from_base = root.map_or(Placement::IDENTITY, |f| self.frames[f].placement.inverse());
        // The bodies below `root`. One pass is sufficient, because parents precede children.
        let mut below = vec![false; self.joints.len()];
        for (i, joint) in self.joints.iter().enumerate() {
            below[i] = joint.parent == base || joint.parent.is_some_and(|p| below[p]);
        }
        let mut selected = below.clone();
        if let Some(tip) = tip {
            selected = vec![false; self.joints.len()];
            let mut body = self.frames[tip].body;
            while body != base {
                let Some(b) = body.filter(|&b| below[b]) else {
                    return Err(Error::input("tip", format!("is not moved by joints after the root: got {}", self.frames[tip].name)));
                };
                selected[b] = true;
                body = self.joints[b].parent;
            }
        }
        let gravity = root.map_or(self.gravity, |f| self.gravity_in(f));
        let mut arm = Arm { joints: Vec::new(), frames: Vec::new(), mimics: Vec::new(), gravity, ..self.clone() };
        let mut index = vec![None; self.joints.len()];
        for (i, joint) in self.joints.iter().enumerate().filter(|(i, _)| selected[*i]) {
            index[i] = Some(arm.joints.len());
            let on_base = joint.parent == base;
            let placement = if on_base { from_base.then(&joint.placement) } else { joint.placement };
            let parent = if on_base { None } else { joint.parent.and_then(|p| index[p]) };
            arm.joints.push(super::Joint { parent, placement, ..joint.clone() });
        }
        for frame in &self.frames {
            match frame.body {
                body if body == base => arm.frames.push(Frame { body: None, placement: from_base.then(&frame.placement), ..frame.clone() }),
                Some(b) if selected[b] => arm.frames.push(Frame { body: index[b], ..frame.clone() }),
                _ => {}
            }
        }
        self.mimics_of(&mut arm, |i| index[i])?;
        let gone: Vec<&str> = (0..self.joints.len()).filter(|&i| !selected[i]).map(|i| self.joints[i].name.as_str()).collect();
        if !gone.is_empty() {
            arm.report.push(format!("dropped: joints outside the sub-chain, and what they carry: {}", listed(&gone)));
        }
        Ok(arm)
    }

    /// Return gravity in the axes of a frame, with all coordinates at zero. m/s^2.
    fn gravity_in(&self, frame: usize) -> [f64; 3] {
        let mut positions = vec![0.0; self.joints.len()];
        self.joint_positions(&vec![0.0; self.n()], &mut positions);
        let (mut placement, mut body) = (self.frames[frame].placement, self.frames[frame].body);
        while let Some(b) = body {
            let joint = &self.joints[b];
            placement = joint.placement.then(&joint.kind.displacement(joint.axis, positions[b])).then(&placement);
            body = joint.parent;
        }
        // Adding zero removes the sign of a negative zero.
        placement.rotation.apply_transposed(Vector3::from(self.gravity)).array().map(|x| x + 0.0)
    }

    /// Set the mimic joints of a part of this arm. `index(i)` is the index of joint `i` in the part, or `None` if the part does not contain
    /// it.
    fn mimics_of(&self, part: &mut Arm, index: impl Fn(usize) -> Option<usize>) -> Result<()> {
        let leader = |mimic: &Mimic| {
            let (Mimic { multiplier, offset, .. }, of) = (*mimic, &self.joints[mimic.leader]);
            Leader { at: index(mimic.leader), name: of.name.clone(), moved: of.moved(), multiplier, offset }
        };
        let mimics: Vec<(usize, Leader)> = self.mimics.iter().filter_map(|mimic| Some((index(mimic.joint)?, leader(mimic)))).collect();
        part.set_mimics(mimics)
    }
}
