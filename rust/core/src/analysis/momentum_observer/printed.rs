//! A momentum observer as C code: `init`, `update` and, if thresholds are known, `contact` (see [`crate::trace::c`]).
//!
//! The C code computes the same bits as [`MomentumObserver::update`]. Within `I + K dt`, products and sums are always fused.

use super::MomentumObserver;
use super::momentum::{Gained, Momentum};
use crate::dynamics::given;
use crate::error::{Error, Result};
use crate::law::parents;
use crate::linalg::AnyGain;
use crate::linalg::cholesky::factor_into;
use crate::scalar::Real;
use crate::trace::Sym;
use crate::trace::c::{CFile, COptions, CSource, Routine, array};
use crate::trace::function::{Recorded, recorded};

/// The largest number of joints of an arm whose observer is printed.
const MOST_JOINTS: usize = 60;

/// The C functions `init` and `update`. `print_update` replaces the tokens that start with `$`.
const UPDATE: &str = "void $prefix_init($prefix_state *state)
{
    memset(state, 0, sizeof *state);
}

int $prefix_update($prefix_state *state, const double q[$joints], const double v[$joints], const double tau[$joints], double dt, double residual[$joints])
{
$gain    double next[2 * $joints], x[5 * $joints + 1 + $factor], y[$answers];
    int status = $upper_OK, k;
    if (!$prefix_finite(q, $joints) || !$prefix_finite(v, $joints) || !$prefix_finite(tau, $joints) || !$prefix_finite(&dt, 1))
        status = $upper_NOT_FINITE;
    else if (!(dt > 0.0))
        status = $upper_TIME;
    else if (!$prefix_momentum(q, v, next))
        status = $upper_ANGLE;
    else if (!$prefix_finite(next, 2 * $joints))
        status = $upper_RESULT;
    else if (!state->started)
        memset(y, 0, sizeof y);
    else {
        memcpy(x, state->residual, $joints * sizeof(double));
        memcpy(x + $joints, state->momentum, $joints * sizeof(double));
        memcpy(x + 2 * $joints, state->drift, $joints * sizeof(double));
        memcpy(x + 3 * $joints, tau, $joints * sizeof(double));
        memcpy(x + 4 * $joints, next, $joints * sizeof(double));
        x[5 * $joints] = dt;
        for (k = 0; k < $factor; k++)
            x[5 * $joints + 1 + k] = fma(gain[k], dt, $identity);
        $prefix_correct(x, y);
        if (!$prefix_finite(y, $joints) || !$prefix_finite(x + 5 * $joints + 1, $factor)$definite)
            status = $upper_RESULT;
    }
    if (status == $upper_OK) {
        memcpy(state->residual, y, $joints * sizeof(double));
        memcpy(state->momentum, next, $joints * sizeof(double));
        memcpy(state->drift, next + $joints, $joints * sizeof(double));
        state->started = 1;
    }
    memcpy(residual, state->residual, $joints * sizeof(double));
    return status;
}
";

/// The C function `contact`. The tokens `$threshold` and `$parent` are replaced by tables.
const CONTACT: &str = "
int $prefix_contact(const $prefix_state *state)
{
$threshold$parent    int inner[$joints] = {0}, found = -1, i, k;
    double most = 0.0;
    for (i = 0; i < $joints; i++)
        if (fabs(state->residual[i]) > threshold[i])
            for (k = parent[i]; k >= 0 && !inner[k]; k = parent[k])
                inner[k] = 1;
    for (i = 0; i < $joints; i++) {
        const double level = fabs(state->residual[i]) / threshold[i];
        if (fabs(state->residual[i]) > threshold[i] && !inner[i] && level >= most) {
            found = i;
            most = level;
        }
    }
    return found;
}
";

/// The declarations of the header. `declare` replaces the tokens that start with `$`.
const HEADER: &str = "
/* The state of an observer. */
typedef struct {
    double residual[$joints]; /* estimated external torque, N m or N */
    double momentum[$joints]; /* at the last sample */
    double drift[$joints]; /* rate of the momentum without torques, at the last sample */
    int started; /* whether there was a sample */
} $prefix_state;

/* Set the state for the start of a run. */
void $prefix_init($prefix_state *state);

/* Compute one sample from the $parts now, and the $torque since the last sample, dt s ago.
   The first sample starts the observer, with the residual 0. $upper_TIME: dt is not positive.
   If the status is not $upper_OK, the state and the residual do not change. */
int $prefix_update($prefix_state *state, const double q[$joints], const double v[$joints], const double tau[$joints], double dt, double residual[$joints]);
";

const CONTACT_HEADER: &str = "
/* Return the index, from 0, of the outermost joint whose residual exceeds its threshold, or -1. Its link is the touched link. */
int $prefix_contact(const $prefix_state *state);
";

/// A C function with recorded operations. `print` replaces the tokens that start with `$`.
const FUNCTION: &str = "static int $prefix_$name($parameters, double *y)
{
$locals    int sound = 1;
$steps    return sound;
}

";

impl MomentumObserver {
    /// Print the observer as C: a header, a source file and a CMake file. The C code starts with a new state. Errors: `Input` for too many
    /// joints or invalid options.
    ///
    /// ```
    /// use armlet_core::analysis::momentum_observer::MomentumObserver;
    /// use armlet_core::arm::Arm;
    /// use armlet_core::linalg::Gain;
    /// use armlet_core::trace::c::COptions;
    ///
    /// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
    /// let observer = MomentumObserver::new(arm.into(), Gain::scalar("gain", 2, 50.0)?, false)?;
    /// let files = observer.export_c(&COptions::new("observer"))?;
    /// assert!(files[0].text.contains("int observer_update("));
    /// # Ok::<(), armlet_core::error::Error>(())
    /// ```
    pub fn export_c(&self, options: &COptions) -> Result<Vec<CFile>> {
        let n = self.n();
        if n > MOST_JOINTS {
            let problem = format!("is too long to be printed: expected an arm of at most {MOST_JOINTS} joints, got {n}");
            return Err(Error::input("observer", problem));
        }
        let mut source = CSource::new(options)?;
        let branches = || Error::input("observer", "has no C: its code branches on its data");
        let momentum = self.recorded_momentum().ok_or_else(branches)?;
        let correct = self.recorded_correction().ok_or_else(branches)?;
        let (prefix, upper, joints) = (source.prefix().to_string(), source.upper().to_string(), n.to_string());
        let names = [("$prefix", prefix.as_str()), ("$upper", &upper), ("$joints", &joints)];
        source.define("N", n, "joints");
        self.declare(&mut source, &names);
        let copies =
            format!("    double x[2 * {n}];\n    memcpy(x, q, {n} * sizeof(double));\n    memcpy(x + {n}, v, {n} * sizeof(double));\n");
        print(
            &mut source,
            &momentum,
            &names,
            &[("$name", "momentum"), ("$parameters", "const double *q, const double *v"), ("$locals", &copies)],
        );
        print(&mut source, &correct, &names, &[("$name", "correct"), ("$parameters", "const double *x"), ("$locals", "")]);
        self.print_update(&mut source, &names, correct.answer.len());
        if let Some(thresholds) = self.thresholds() {
            let parents: Vec<String> =
                parents(&self.model).iter().map(|joint| joint.map_or("-1".into(), |joint| joint.to_string())).collect();
            let parents = format!("    static const int parent[{n}] = {{ {} }};\n", parents.join(", "));
            source.write(&filled(CONTACT, &names, &[("$threshold", &array("threshold", thresholds)), ("$parent", &parents)]));
        }
        let of = if self.motors.is_some() { "motors of an arm with elastic joints" } else { "links of an arm" };
        let about = format!("A momentum observer of armlet: the external torque on the {of}.\n\n{}", self.model.described());
        Ok(source.files(&about))
    }

    fn print_update(&self, source: &mut CSource, names: &[Filling], answers: usize) {
        let (n, full) = (self.n(), !self.given.is_diagonal());
        let gains: Vec<f64> = if full { self.given.matrix() } else { (0..n).map(|i| self.given.at(i, i)).collect() };
        let identity = if full { format!("k / {n} == k % {n} ? 1.0 : 0.0") } else { "1.0".to_string() };
        let definite = if full { format!(" || !(y[{n}] > 0.5)") } else { String::new() };
        let more = [
            ("$answers", answers.to_string()),
            ("$factor", gains.len().to_string()),
            ("$gain", array("gain", &gains)),
            ("$identity", identity),
            ("$definite", definite),
        ];
        let more: Vec<Filling> = more.iter().map(|(token, text)| (*token, text.as_str())).collect();
        source.write(&filled(UPDATE, names, &more));
    }

    fn declare(&self, source: &mut CSource, names: &[Filling]) {
        let words = if self.motors.is_some() {
            [("$parts", "positions and velocities of the motors"), ("$torque", "motor torques minus joint torques")]
        } else {
            [("$parts", "positions and velocities"), ("$torque", "torques")]
        };
        source.declare(&filled(HEADER, names, &words));
        if self.thresholds().is_some() {
            source.declare(&filled(CONTACT_HEADER, names, &[]));
        }
    }

    /// Record the momentum `p` and the drift `C' v - g - tau_f` as functions of `q` and `v`.
    fn recorded_momentum(&self) -> Option<Recorded> {
        let n = self.n();
        let made = || Momentum::<Sym>::new(&self.model, self.motors.as_ref(), &self.friction);
        recorded(2 * n, made, |mut sample, x| {
            let mut answer = vec![Sym::zero(); 2 * n];
            let (momentum, drift) = answer.split_at_mut(n);
            sample.momentum_and_drift(&x[..n], &x[n..], momentum, drift);
            answer
        })
    }

    /// Record the correction of the residual.
    ///
    /// The inputs are: the residual, the momentum and the drift `C' v - g - tau_f` at the last sample, the torque, the momentum now, `dt`,
    /// and `I + K dt`. For a full gain the result has one more number after the residual: one if `I + K dt` is positive definite, else
    /// zero.
    fn recorded_correction(&self) -> Option<Recorded> {
        let n = self.n();
        let sums = if self.given.is_diagonal() { n } else { n * n };
        recorded(
            5 * n + 1 + sums,
            || AnyGain::<Sym>::new(&self.given),
            |gain, x| {
                let part = |k: usize| &x[k * n..(k + 1) * n];
                let (dt, sum) = (x[5 * n], &x[5 * n + 1..]);
                let (mut residual, mut factor, mut work) = (part(0).to_vec(), sum.to_vec(), vec![Sym::zero(); n]);
                let definite = matches!(gain, AnyGain::Full(_)).then(|| factor_into(n, sum, &mut factor));
                let gained = Gained { momentum: part(1), drift: part(2), now: part(4) };
                gained.correct((&gain, &factor), (part(3), dt), &mut work, &mut residual);
                residual.extend(definite);
                residual
            },
        )
    }
}

/// A token of a text, and its replacement.
type Filling<'a> = (&'a str, &'a str);

/// A text with its tokens replaced.
fn filled(text: &str, names: &[Filling], more: &[Filling]) -> String {
    more.iter().chain(names).fold(text.to_string(), |text, (token, by)| text.replace(token, by))
}

/// Print recorded operations as a C function.
fn print(source: &mut CSource, recorded: &Recorded, names: &[Filling], more: &[Filling; 3]) {
    let given = given(recorded);
    let routine = Routine { ops: &recorded.ops, given: &given, answer: &recorded.answer, fused: source.fused() };
    let [name, parameters, (locals, own)] = *more;
    let (steps, slots) = source.routine(&routine, name.1);
    let locals_text = if slots > 0 { format!("    double w[{slots}];\n{own}") } else { own.to_string() };
    source.write(&filled(FUNCTION, names, &[name, parameters, (locals, &locals_text), ("$steps", &steps)]));
}
