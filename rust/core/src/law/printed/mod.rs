//! A law as C code: the functions `init` and `step` of a sampled controller (see [`crate::trace::c`]).
//!
//! A step computes the plant's input at time `t` from the measured state of the plant. It has the same bits as [`LawEvaluator`](super::LawEvaluator) and
//! as sampled loops. Between two samples, the rate `z'` of the law's state `z` is constant. `z` advances over a step `h` by a fixed-step
//! method:
//!
//! `z += h z'` (euler, semi_implicit),   `z += h/6 (k + 2 k + 2 k + k)` (rk4, whose four stages have the same rate `k = z'`)

mod c_loop;
mod motion;

pub use c_loop::CLoop;

use crate::dynamics::{Quantity, given};
use crate::error::{Error, Result};
use crate::law::evaluator::{recording, start_recording};
use crate::law::{LawSpec, Route};
use crate::motion::Motion;
use crate::plant::PlantKind;
use crate::scalar::hex::hex;
use crate::trace::c::{CFile, COptions, CSource, Routine, array};

/// The largest number of steps of the law's state between two calls. If more are necessary, one step covers the whole time.
const MOST_STEPS: u32 = 10_000;

/// The largest estimated number of operations of a law that can be printed as C.
const LONGEST: f64 = 600_000.0;

/// The sizes of a printed law.
struct PrintedSizes {
    /// Number of joints.
    n: usize,
    /// Length of the law's state.
    p: usize,
    /// Number of values of the desired motions that change with time.
    moving: usize,
    /// Length of the measured state of the plant.
    states: usize,
    /// Whether the law reports that an evaluation is not valid.
    guarded: bool,
}

impl LawSpec {
    /// Print the law as C: a header, a source file and a CMake file.
    ///
    /// Errors: `Input` for a law that branches on its data, a function of the caller, or a law or motion that is too long. `Input` or
    /// `WrongShape` for invalid `options` or `timing`.
    ///
    /// ```
    /// use armlet_core::arm::Arm;
    /// use armlet_core::law::{CLoop, Gain, LawSpec, PdGravitySpec};
    /// use armlet_core::motion::Motion;
    /// use armlet_core::trace::c::COptions;
    /// use nalgebra::dvector;
    ///
    /// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
    /// let law = PdGravitySpec::new(arm.into(), dvector![0.3, 0.2], Gain::scalar("kp", 2, 40.0)?, Gain::scalar("kd", 2, 9.0)?)?;
    /// let files = LawSpec::from(law).export_c(&COptions::new("law"), &CLoop::default())?;
    /// assert!(files[0].text.contains("int law_step("));
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn export_c(&self, options: &COptions, timing: &CLoop) -> Result<Vec<CFile>> {
        let refused =
            |why: &str| Err(Error::input("law", format!("has no C: expected a law that is straight-line code, got {} {why}", self.name())));
        match self.route() {
            Route::Outside => return refused("of a function in Python"),
            Route::Deciding => return refused("with a map that branches on its data: scaled commands"),
            Route::Straight | Route::Guarded | Route::Bounded => {}
        }
        let (period, limits) = timing.checked(self)?;
        self.require_short()?;
        let (mut source, motions) = (CSource::new(options)?, self.motions());
        let widths =
            [motions.iter().map(|motion| 3 * motion.dof()).sum(), self.plant().states(self.model().n()), self.initial_state().len()];
        let recorded = recording(self, widths, period, limits);
        let mut given = given(&recorded);
        let mut at = recorded.values.len();
        for motion in &motions {
            if let Motion::Hold(q) = motion {
                let rest = q.iter().copied().chain(std::iter::repeat_n(0.0, 2 * q.len()));
                given[at..at + 3 * q.len()].iter_mut().zip(rest).for_each(|(given, x)| *given = Some(x));
            }
            at += 3 * motion.dof();
        }
        let held: usize = motions.iter().map(|motion| if motion.moves() { 0 } else { 3 * motion.dof() }).sum();
        let sizes = PrintedSizes {
            n: self.model().n(),
            p: widths[2],
            moving: widths[0] - held,
            states: widths[1],
            guarded: recorded.answer.len() > self.model().n() + widths[2],
        };
        let calls = self.print_motions(&mut source)?;
        let routine = Routine { ops: &recorded.ops, given: &given, answer: &recorded.answer, fused: source.fused() };
        let (steps, slots) = source.routine(&routine, "evaluate");
        let starts = self.print_start(&mut source, &sizes);
        self.declare(&mut source, &sizes, timing);
        self.write_state(&mut source, &sizes, timing);
        self.write_step(&mut source, &sizes, timing, (&calls, &steps, slots, starts));
        Ok(source.files(&self.about(timing)))
    }

    /// Refuse a law whose C code would be too long.
    fn require_short(&self) -> Result<()> {
        let (model, p) = (self.model(), self.initial_state().len() as f64);
        let query = if self.adaptive().is_some() { Quantity::Regressor } else { Quantity::CoriolisMatrix };
        if model.operations(&query.into()) + p * p > LONGEST {
            let problem = format!("is too long to be printed: expected an arm with fewer joints, got {} joints", model.n());
            return Err(Error::input("law", problem));
        }
        Ok(())
    }

    /// Print the functions of the motions that change with time. Return the code that calls them.
    fn print_motions(&self, source: &mut CSource) -> Result<String> {
        let (mut calls, mut at) = (String::new(), 0);
        for (k, motion) in self.motions().into_iter().enumerate() {
            let name = format!("motion_{}", k + 1);
            if motion.print_c(source, &name)? {
                calls += &format!("    {}_{name}(t, x + {at});\n", source.prefix());
                at += 3 * motion.dof();
            }
        }
        Ok(calls)
    }

    /// Print a function that sets the law's state at the first measurement. Return whether the law requires it.
    fn print_start(&self, source: &mut CSource, sizes: &PrintedSizes) -> bool {
        let Some(recorded) = start_recording(self, sizes.states) else { return false };
        let given = given(&recorded);
        let routine = Routine { ops: &recorded.ops, given: &given, answer: &recorded.answer, fused: source.fused() };
        let (steps, slots) = source.routine(&routine, "begin");
        let work = if slots > 0 { format!(", w[{slots}]") } else { String::new() };
        let prefix = source.prefix().to_string();
        source.write(&format!(
            "/* Set the law's own state for the first measurement x. */
static void {prefix}_start(const double x[{}], double state[{p}])\n{{\n    \
double y[{p}]{work};\n    int sound = 1;\n{steps}    (void)sound;\n    memcpy(state, y, sizeof y);\n}}\n\n",
            sizes.states,
            p = sizes.p
        ));
        true
    }

    fn parameters(&self, n: usize) -> String {
        // Every `step` has the argument `v`, even if the law does not read it.
        let names = if self.plant().has_speeds() { self.plant().parts() } else { &["q", "v"] };
        names.iter().map(|name| format!("const double {name}[{n}], ")).collect()
    }

    fn head(&self, prefix: &str, n: usize) -> String {
        format!("int {prefix}_step({prefix}_state *state, double t, {}double tau[{n}])", self.parameters(n))
    }

    /// Write the declarations of the header.
    fn declare(&self, source: &mut CSource, sizes: &PrintedSizes, timing: &CLoop) {
        let (prefix, n, p) = (source.prefix().to_string(), sizes.n, sizes.p);
        source.define("N", n, "number of joints");
        source.define("STATES", p, "length of the law's own state");
        if let (Some(dt), true) = (timing.dt, p > 0) {
            source.define("DT", hex(dt), &format!("step of the law's own state: {dt} s"));
        }
        let own = if p == 0 {
            String::new()
        } else {
            format!(
                "    double state[{p}]; /* the law's own state at the last call */\n    double rate[{p}]; /* its rate, held until the next call */\n    \
double t; /* time of the last call, s */\n    int started; /* whether there was a call */\n"
            )
        };
        let input = match self.plant() {
            PlantKind::Velocity => "commanded velocity of the joints",
            PlantKind::Rigid => "torque",
            PlantKind::Elastic => "torque of the motors",
        };
        source.declare(&format!(
            "\n/* The state of a controller. */\ntypedef struct {{\n    double tau[{n}]; /* the last valid result; zeros before the first one */\n{own}}} {prefix}_state;\n\n\
/* Set the state for the start of a run. */\nvoid {prefix}_init({prefix}_state *state);\n\n/* Compute one sample: the {input} at time t, s, for the measured state of the joints{}.\n   \
If the status is not 0, tau is the last valid result. */\n{};\n",
            match self.plant() {
                PlantKind::Elastic => " and motors",
                PlantKind::Velocity => "; v is not read",
                PlantKind::Rigid => "",
            },
            self.head(&prefix, n)
        ));
    }

    /// Write the C function `init`, and the C function that advances the law's state by one step.
    fn write_state(&self, source: &mut CSource, sizes: &PrintedSizes, timing: &CLoop) {
        let (prefix, p) = (source.prefix().to_string(), sizes.p);
        let start = self.initial_state();
        let filled = p > 0 && start.iter().any(|&x| x != 0.0);
        let initial = if filled { array("start", start) } else { String::new() };
        let copied = if filled { "    memcpy(state->state, start, sizeof start);\n" } else { "" };
        source.write(&format!(
            "void {prefix}_init({prefix}_state *state)\n{{\n{initial}    memset(state, 0, sizeof *state);\n{copied}}}\n\n"
        ));
        if p == 0 {
            return;
        }
        let fma = |a: &str, b: &str, c: &str| source.multiply_add(a, b, c);
        let step = if timing.rk4 {
            format!(
                "    const double sixth = h / 6.0;\n    int i;\n    for (i = 0; i < {p}; i++) {{\n        const double k = state->rate[i], \
two = {}, four = {};\n        state->state[i] = {};\n    }}\n",
                fma("2.0", "k", "k"),
                fma("2.0", "k", "two"),
                fma("sixth", "(four + k)", "state->state[i]")
            )
        } else {
            let sum = fma("h", "state->rate[i]", "state->state[i]");
            format!("    int i;\n    for (i = 0; i < {p}; i++)\n        state->state[i] = {sum};\n")
        };
        let Some(_) = timing.dt else {
            source.write(&format!("static void {prefix}_advance({prefix}_state *state, double h)\n{{\n{step}}}\n\n"));
            return;
        };
        source.write(&format!("static void {prefix}_advance_by({prefix}_state *state, double h)\n{{\n{step}}}\n\n"));
        self.write_advance(source);
    }

    /// Write the C function `advance`, which advances the law's state from the last call to the time `t`.
    fn write_advance(&self, source: &mut CSource) {
        let (prefix, upper) = (source.prefix().to_string(), source.upper().to_string());
        let mut breaks: Vec<f64> = self.breaks().into_iter().filter(|&t| t > 0.0).collect();
        breaks.dedup();
        let whole_step = if breaks.is_empty() {
            format!("        {prefix}_advance_by(state, {upper}_DT);\n")
        } else {
            // If a derivative of a motion jumps within a step, the step is divided at the jump, as in a loop of fixed steps.
            format!(
                "        double at = k * {upper}_DT, h = {upper}_DT;
        const double stop = (k + 1.0) * {upper}_DT;
        for (;;) {{
            int jumps = 0;
            double piece = h;
            while (next < {0} && breaks[next] <= at + near)
                next++;
            if (next < {0} && breaks[next] <= stop + near) {{
                jumps = 1;
                piece = fabs(breaks[next] - stop) <= near ? stop - at : breaks[next] - at;
            }}
            {prefix}_advance_by(state, piece);
            if (!jumps)
                break;
            next++;
            at += piece;
            h = stop - at;
            if (fabs(at - stop) <= near)
                break;
        }}
",
                breaks.len()
            )
        };
        let (table, next) = if breaks.is_empty() {
            (String::new(), "")
        } else {
            (array("breaks", &breaks), "    const double near = 1e-9 * DT;\n    int next = 0;\n")
        };
        let next = next.replace("DT", &format!("{upper}_DT"));
        source.write(&format!(
            "/* Advance the law's own state from the last call to t: by whole steps, or by one step if a time lies between steps. */
static void {prefix}_advance({prefix}_state *state, double t)
{{
{table}{next}    const double first = floor(state->t / {upper}_DT + 0.5), last = floor(t / {upper}_DT + 0.5);
    double k;
    if (fabs(t - last * {upper}_DT) > 1e-6 * {upper}_DT || fabs(state->t - first * {upper}_DT) > 1e-6 * {upper}_DT || last - first > {MOST_STEPS}.0) {{
        {prefix}_advance_by(state, t - state->t);
        return;
    }}
    for (k = first; k < last; k += 1.0) {{
{whole_step}    }}
}}

"
        ));
    }

    fn write_step(
        &self,
        source: &mut CSource,
        sizes: &PrintedSizes,
        timing: &CLoop,
        (motions, steps, slots, starts): (&str, &str, usize, bool),
    ) {
        let PrintedSizes { n, p, moving, states, guarded } = *sizes;
        let (prefix, upper) = (source.prefix().to_string(), source.upper().to_string());
        let parts = self.plant().parts();
        let copies: String = parts
            .iter()
            .enumerate()
            .map(|(k, name)| format!("    memcpy(x + {}, {name}, {n} * sizeof(double));\n", moving + k * n))
            .collect();
        let unread = if self.plant().has_speeds() { "" } else { "    (void)v;\n" };
        let work = if slots > 0 { format!(", w[{slots}]") } else { String::new() };
        let (answers, count) = (n + p + usize::from(guarded), moving + states + p);
        let advance = if p == 0 {
            String::new()
        } else {
            let argument = if timing.dt.is_some() { "t" } else { "t - state->t" };
            let begin = if starts { format!("    else\n        {prefix}_start(x + {moving}, state->state);\n") } else { String::new() };
            format!(
                "    if (state->started && t < state->t) {{\n        memcpy(tau, state->tau, sizeof state->tau);\n        return {upper}_TIME;\n    }}\n    \
if (state->started)\n        {prefix}_advance(state, {argument});\n{begin}    state->t = t;\n    state->started = 1;\n    \
memcpy(x + {}, state->state, sizeof state->state);\n",
                moving + states
            )
        };
        let decided =
            if guarded { format!("    else if (!(y[{}] > 0.5))\n        status = {upper}_UNDECIDED;\n", n + p) } else { String::new() };
        let rate = if p > 0 { format!("        memcpy(state->rate, y + {n}, sizeof state->rate);\n") } else { String::new() };
        source.write(&format!(
            "{}
{{
    double x[{count}], y[{answers}]{work};
    int sound = 1, status = {upper}_OK;
{unread}{copies}    if (!{prefix}_finite(&t, 1) || !{prefix}_finite(x + {moving}, {states})) {{
        memcpy(tau, state->tau, sizeof state->tau);
        return {upper}_NOT_FINITE;
    }}
{advance}{motions}{steps}    if (!sound)
        status = {upper}_ANGLE;
{decided}    else if (!{prefix}_finite(y, {}))
        status = {upper}_RESULT;
    if (status == {upper}_OK) {{
        memcpy(state->tau, y, sizeof state->tau);
{rate}    }}
    memcpy(tau, state->tau, sizeof state->tau);
    return status;
}}
",
            self.head(&prefix, n),
            n + p
        ));
    }

    /// Describe the law for the header.
    fn about(&self, timing: &CLoop) -> String {
        let mut text = format!("The law {} of armlet, for {}.\n\n{}\n", self.name(), self.plant().name(), self.model().described());
        for (k, motion) in self.motions().into_iter().enumerate() {
            text += &format!("Desired motion {}: {}.\n", k + 1, motion.described());
        }
        if !self.initial_state().is_empty() {
            text += &match timing.dt {
                Some(dt) => format!(
                    "The law's own state advances by steps of {dt} s ({}) if calls are at multiples of this step. The bits are those of a sampled loop of armlet with this dt.\n",
                    if timing.rk4 { "rk4" } else { "euler, semi_implicit" }
                ),
                None => "The law's own state advances by one step from call to call.\n".to_string(),
            };
        }
        if let Some(period) = timing.sample_time.filter(|_| self.samples()) {
            text += &format!("Call it every {period} s.\n");
        }
        if timing.tau_max.is_some() {
            text += "tau is limited.\n";
        }
        text.trim_end().to_string()
    }
}
