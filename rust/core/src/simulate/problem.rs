//! What is to be run, validated.

use super::adaptive_steps::Segments;
use super::schedule::{Schedule, Times};
use crate::dynamics::PlanarPr;
use crate::error::{Error, Result, finite, positive};
use crate::law::LawSpec;

/// The numerical method of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Rk4,
    Dop853,
}

impl Method {
    pub const NAMES: [(&'static str, Method); 2] = [("rk4", Method::Rk4), ("dop853", Method::Dop853)];

    pub fn from_name(name: &str) -> Result<Self> {
        let names: Vec<&str> = Self::NAMES.iter().map(|(n, _)| *n).collect();
        match Self::NAMES.iter().find(|(n, _)| *n == name) {
            Some((_, method)) => Ok(*method),
            None => Err(Error::input("method", format!("is unknown: expected one of {}, got {name}", names.join(", ")))),
        }
    }

    pub fn is_adaptive(self) -> bool {
        self == Method::Dop853
    }
}

/// How to run it.
#[derive(Clone, Debug)]
pub struct Options {
    pub t_end: f64,
    /// Step of a fixed-step method.
    pub dt: Option<f64>,
    pub method: Method,
    pub rtol: f64,
    pub atol: f64,
    /// `None`: the law is evaluated in every stage; a period: its output is held that long.
    pub sample_time: Option<f64>,
    pub times: Times,
    /// Largest |tau| per joint, `(n,)`.
    pub tau_max: Option<Vec<f64>>,
    pub monitors: bool,
}

/// Runs that share everything but their initial states, and possibly their plants and laws.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// One, or one per run.
    pub plants: Vec<&'a PlanarPr<f64>>,
    /// One, or one per run.
    pub laws: Vec<&'a LawSpec>,
    /// `(B, n)`, row-major.
    pub q0: Vec<f64>,
    pub v0: Vec<f64>,
    pub options: Options,
}

/// How time is divided: by fixed steps or by the method.
pub enum Division {
    Fixed(Fixed),
    Adaptive(Segments),
}

/// Steps of one size.
pub struct Fixed {
    pub schedule: Schedule,
    /// Steps per sample of a sampled law, 0 without sampling.
    pub hold: usize,
}

impl Problem<'_> {
    pub const DOF: usize = 2;

    pub fn runs(&self) -> usize {
        self.q0.len() / Self::DOF
    }

    pub fn plant(&self, run: usize) -> &PlanarPr<f64> {
        self.plants[if self.plants.len() == 1 { 0 } else { run }]
    }

    pub fn law(&self, run: usize) -> &LawSpec {
        self.laws[if self.laws.len() == 1 { 0 } else { run }]
    }

    /// Refuse what can't be run; the division of time of what can.
    pub fn validate(&self) -> Result<Division> {
        let o = &self.options;
        if !(o.t_end >= 0.0 && o.t_end.is_finite()) {
            return Err(Error::input("t_end", format!("is not a duration: expected a finite number >= 0, got {}", o.t_end)));
        }
        finite("q0", &self.q0)?;
        finite("v0", &self.v0)?;
        let runs = self.runs();
        for (name, count) in [("plant", self.plants.len()), ("law", self.laws.len())] {
            if count != 1 && count != runs {
                return Err(Error::input(name, format!("has the wrong number of entries: expected 1 or {runs}, got {count}")));
            }
        }
        let kind = |law: &LawSpec| std::mem::discriminant(law);
        if let Some(i) = self.laws.iter().position(|law| kind(law) != kind(self.laws[0])) {
            return Err(Error::input(
                "law",
                format!("mixes kinds: expected {} throughout, got {} (first bad index {i})", self.laws[0].name(), self.laws[i].name()),
            ));
        }
        let limit = o.tau_max.as_deref().unwrap_or_default();
        if let Some(i) = limit.iter().position(|&x| !(x > 0.0)) {
            return Err(Error::input("tau_max", format!("is not positive: expected > 0, got {} (first bad index {i})", limit[i])));
        }
        if let Some(period) = o.sample_time {
            positive("sample_time", period)?;
        }
        let mut breaks: Vec<f64> = self.laws.iter().flat_map(|law| law.motion().breaks()).collect();
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        if o.method.is_adaptive() {
            positive("rtol", o.rtol)?;
            if !(o.atol >= 0.0 && o.atol.is_finite()) {
                return Err(Error::input("atol", format!("is negative or not finite: expected a number >= 0, got {}", o.atol)));
            }
            if o.rtol < 1e-15 {
                return Err(Error::input("rtol", format!("is below what a double resolves: expected at least 1e-15, got {}", o.rtol)));
            }
            return Ok(Division::Adaptive(Segments::new(o.t_end, o.times.clone(), &breaks, o.sample_time)?));
        }
        let Some(dt) = o.dt.or(o.sample_time) else {
            return Err(Error::input("dt", "is missing: expected a step in seconds for a fixed-step method, got None"));
        };
        let schedule = Schedule::new(dt, o.t_end, &o.times, &breaks)?;
        let hold = match o.sample_time {
            None => 0,
            Some(period) => {
                let ratio = period / dt;
                if ratio.round() < 1.0 || (ratio - ratio.round()).abs() > 1e-9 * ratio {
                    return Err(Error::input("sample_time", format!("is not a multiple of dt: expected k * {dt}, got {period}")));
                }
                ratio.round() as usize
            }
        };
        Ok(Division::Fixed(Fixed { schedule, hold }))
    }
}
