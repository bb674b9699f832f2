//! The pickle of an arm that is a tree of joints: `(integers, numbers, text)`, three strings of bytes, little-endian.
//!
//! Bytes can be written and read without the interpreter lock, which matters for arms of many links.
//!
//! ```text
//! integers  numbers of joints, frames and remarks; parent of each joint; body of each frame, and 1 if the frame has a fixed joint, else 0;
//!           index of each mimic joint and of its leader; lengths of all strings
//! numbers   gravity; placement, axis, limits, drive and ten parameters of each joint; placement of each frame; multiplier and
//!           offset of each mimic joint
//! text      name of the arm; name and kind of each joint; name of each frame, and name of its fixed joint; remarks of the report
//! ```

use super::Arm;
use crate::errors::Failure;
use crate::interrupts::long;
use crate::seal::bytes;
use armlet_core::arm::{self as core, Frame, Joint, JointType, Limits, Mimic};
use armlet_core::error::{Error, Result as CoreResult};
use armlet_core::interrupt;
use armlet_core::memory;
use armlet_core::spatial::{Matrix3, Placement, Vector3};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The count of float64 numbers of a placement (9 of the rotation, 3 of the translation), and of a joint.
const PLACEMENT: usize = 12;
const JOINT: usize = PLACEMENT + 3 + 7 + 10;
/// The stored index of "no parent" and "no body".
const NONE: i64 = -1;

#[derive(Default)]
struct Stored {
    integers: Vec<u8>,
    numbers: Vec<u8>,
    text: Vec<u8>,
    lengths: Vec<u8>,
}

impl Stored {
    fn integer(&mut self, x: i64) -> CoreResult<()> {
        memory::append(&mut self.integers, &x.to_le_bytes())
    }

    fn index(&mut self, x: Option<usize>) -> CoreResult<()> {
        self.integer(x.map_or(NONE, |x| x as i64))
    }

    fn numbers(&mut self, all: &[f64]) -> CoreResult<()> {
        all.iter().try_for_each(|x| memory::append(&mut self.numbers, &x.to_le_bytes()))
    }

    fn placement(&mut self, p: &Placement) -> CoreResult<()> {
        self.numbers(p.rotation.as_slice())?;
        self.numbers(p.translation.as_slice())
    }

    fn text(&mut self, text: &str) -> CoreResult<()> {
        memory::append(&mut self.lengths, &(text.len() as i64).to_le_bytes())?;
        memory::append(&mut self.text, text.as_bytes())
    }

    fn of(arm: &core::Arm) -> CoreResult<Self> {
        let mut out = Stored::default();
        for count in [arm.joints.len(), arm.frames.len(), arm.report.len()] {
            out.integer(count as i64)?;
        }
        out.text(&arm.name)?;
        out.numbers(&arm.gravity)?;
        for j in &arm.joints {
            interrupt::check();
            out.index(j.parent)?;
            out.placement(&j.placement)?;
            out.numbers(&j.axis)?;
            out.numbers(&[j.limits.lower, j.limits.upper, j.limits.velocity, j.limits.effort, j.armature, j.damping, j.friction])?;
            out.numbers(&j.parameters)?;
            out.text(&j.name)?;
            out.text(j.kind.name())?;
        }
        for f in &arm.frames {
            interrupt::check();
            out.index(f.body)?;
            out.integer(i64::from(f.joint.is_some()))?;
            out.placement(&f.placement)?;
            out.text(&f.name)?;
            out.text(f.joint.as_deref().unwrap_or_default())?;
        }
        for m in &arm.mimics {
            out.integer(m.joint as i64)?;
            out.integer(m.leader as i64)?;
            out.numbers(&[m.multiplier, m.offset])?;
        }
        arm.report.iter().try_for_each(|remark| out.text(remark))?;
        memory::append(&mut out.integers, &out.lengths)?;
        Ok(out)
    }
}

/// The three strings of bytes of an arm, which are the arguments of [`_restore_arm`].
pub fn stored<'py>(py: Python<'py>, arm: &core::Arm) -> Result<[Bound<'py, PyBytes>; 3], Failure> {
    let Stored { integers, numbers, text, .. } = long(py, || Stored::of(arm))?;
    Ok([bytes(py, &[&integers])?, bytes(py, &[&numbers])?, bytes(py, &[&text])?])
}

/// The unread rest of the three strings. Its methods return `None` if a string ends too early or has an invalid content.
struct Reader<'a> {
    integers: &'a [[u8; 8]],
    numbers: &'a [[u8; 8]],
    lengths: &'a [[u8; 8]],
    text: &'a str,
}

impl<'a> Reader<'a> {
    fn integer(&mut self) -> Option<i64> {
        let (&first, rest) = self.integers.split_first()?;
        self.integers = rest;
        Some(i64::from_le_bytes(first))
    }

    /// Read an index below `end`, or [`NONE`].
    fn index(&mut self, end: usize) -> Option<Option<usize>> {
        match self.integer()? {
            NONE => Some(None),
            x => usize::try_from(x).ok().filter(|&x| x < end).map(Some),
        }
    }

    fn numbers<const N: usize>(&mut self) -> Option<[f64; N]> {
        let (first, rest) = self.numbers.split_first_chunk::<N>()?;
        self.numbers = rest;
        Some(first.map(f64::from_le_bytes))
    }

    fn placement(&mut self) -> Option<Placement> {
        let rotation = Matrix3::from([self.numbers::<3>()?, self.numbers::<3>()?, self.numbers::<3>()?]);
        Some(Placement { rotation, translation: Vector3::from(self.numbers::<3>()?) })
    }

    fn text(&mut self) -> Option<&'a str> {
        let (&first, rest) = self.lengths.split_first()?;
        let (text, behind) = self.text.split_at_checked(usize::try_from(i64::from_le_bytes(first)).ok()?)?;
        (self.lengths, self.text) = (rest, behind);
        Some(text)
    }

    fn joint(&mut self, i: usize) -> Option<Joint> {
        let (parent, placement, axis) = (self.index(i)?, self.placement()?, self.numbers()?);
        let [lower, upper, velocity, effort, armature, damping, friction] = self.numbers()?;
        let (parameters, name) = (self.numbers()?, self.text()?.to_string());
        let JointType::Moving(kind) = JointType::parse(self.text()?)? else { return None };
        let limits = Limits { lower, upper, velocity, effort };
        Some(Joint { name, kind, parent, placement, axis, limits, armature, damping, friction, parameters })
    }

    fn mimic(&mut self, joints: usize) -> Option<Mimic> {
        let (joint, leader, [multiplier, offset]) = (self.index(joints)??, self.index(joints)??, self.numbers()?);
        Some(Mimic { joint, leader, multiplier, offset })
    }

    fn frame(&mut self, joints: usize) -> Option<Frame> {
        let (body, led) = (self.index(joints)?, self.integer()? == 1);
        let (placement, name, joint) = (self.placement()?, self.text()?.to_string(), self.text()?);
        Some(Frame { name, body, placement, joint: led.then(|| joint.to_string()) })
    }
}

fn arm_of(integers: &[u8], numbers: &[u8], text: &[u8]) -> CoreResult<core::Arm> {
    let damaged = || Error::Format("the stored arm is damaged".into());
    let (integers, numbers) = (integers.as_chunks::<8>().0, numbers.as_chunks::<8>().0);
    let text = std::str::from_utf8(text).map_err(|_| damaged())?;
    let mut reader = Reader { integers, numbers, lengths: &[], text };
    let mut count = || reader.integer().and_then(|n| usize::try_from(n).ok()).filter(|&n| n <= integers.len()).ok_or_else(damaged);
    let (joints, frames, remarks) = (count()?, count()?, count()?);
    // Each count is at most the number of stored integers. So no sum overflows, and the memory is at most proportional to the size of the
    // pickle.
    let strings = 1 + 2 * joints + 2 * frames + remarks;
    let (own_integers, own_numbers) = (3 + joints + 2 * frames + strings, 3 + JOINT * joints + PLACEMENT * frames);
    let mimics = integers.len().checked_sub(own_integers).ok_or_else(damaged)? / 2;
    if integers.len() != own_integers + 2 * mimics || numbers.len() != own_numbers + 2 * mimics {
        return Err(damaged());
    }
    (reader.integers, reader.lengths) = reader.integers.split_at(joints + 2 * frames + 2 * mimics);
    let name = reader.text().ok_or_else(damaged)?.to_string();
    let gravity = reader.numbers().ok_or_else(damaged)?;
    let mut arm = core::Arm {
        name,
        joints: memory::reserved(joints)?,
        mimics: memory::reserved(mimics)?,
        frames: memory::reserved(frames)?,
        gravity,
        report: memory::reserved(remarks)?,
    };
    for i in 0..joints {
        interrupt::check();
        arm.joints.push(reader.joint(i).ok_or_else(damaged)?);
    }
    for _ in 0..frames {
        interrupt::check();
        arm.frames.push(reader.frame(joints).ok_or_else(damaged)?);
    }
    for _ in 0..mimics {
        arm.mimics.push(reader.mimic(joints).ok_or_else(damaged)?);
    }
    if !arm.mimics_are_sound() {
        return Err(damaged());
    }
    for _ in 0..remarks {
        arm.report.push(reader.text().ok_or_else(damaged)?.to_string());
    }
    Ok(arm)
}

/// Restore an arm from the three strings of its pickle.
#[entered]
#[pyfunction]
pub fn _restore_arm(integers: &Bound<'_, PyBytes>, numbers: &Bound<'_, PyBytes>, text: &Bound<'_, PyBytes>) -> Result<Arm, Failure> {
    let (integers, numbers, text) = (integers.as_bytes(), numbers.as_bytes(), text.as_bytes());
    long(py, || Ok(arm_of(integers, numbers, text)?.into()))
}
