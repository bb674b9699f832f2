//! Motions as C code: functions of time with the bits of [`Motion::sample`]. The formulas of [`Motion::sample`] are recorded and printed. The
//! code around them, which finds the piece of a motion, is in this file, with the functions `cosh`, `sinh` and `tanh` of a timing. The bits
//! are equal if the C compiler fuses only calls of `fma()`, and if both call the same C library.

use crate::error::{Error, Result};
use crate::motion::polynomial::chain;
use crate::motion::rest_to_rest::{RestToRest, Timing};
use crate::motion::rows::put;
use crate::motion::{Motion, Sinusoid, Spline, Table, TimedPath, path, table, timed_path};
use crate::scalar::Real;
use crate::scalar::hex::hex;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::trace::c::{CSource, Routine, array};
use crate::trace::sym::{self, Sym};

/// Largest number of values in a printed motion.
const LONGEST: usize = 1 << 20;

fn indented(text: &str) -> String {
    text.lines().map(|line| format!("    {line}\n")).collect()
}

/// C code that sets `low` to the interval of the increasing `table` that contains `value`, from 0 to `last - 1`.
fn search(table: &str, value: &str, last: usize) -> String {
    format!(
        "low = 0;\nhigh = {last};\nwhile (high - low > 1) {{\n    const int middle = (low + high) / 2;\n    \
if ({table}[middle] <= {value}) low = middle; else high = middle;\n}}\n"
    )
}

/// C code that holds the position `hold` of `n` joints.
fn print_hold(hold: &str, n: usize) -> String {
    format!("memset(y, 0, {} * sizeof(double));\nmemcpy(y, {hold}, {n} * sizeof(double));\n", 3 * n)
}

/// C code that declares the rows of a table, and the nearest knot `k`, up to `last`. `u` is the time after the first knot, in intervals.
fn print_nearest(table: &Table, last: usize) -> String {
    format!(
        "{}    const double start = {}, rate = {}, u = (t - start) * rate, near = u + 0.5;
    const long k = !(near > 0.0) ? 0L : near >= {last}.0 ? {last}L : (long)near;\n",
        array("rows", table.rows()),
        hex(table.start()),
        hex(1.0 / table.dt())
    )
}

impl Motion {
    /// Print the C function `static void prefix_name(double t, double *y)`, which writes `[q_d, v_d, a_d]`. Return false for a motion that
    /// holds its position, which requires no function.
    pub(super) fn print_c(&self, source: &mut CSource, name: &str) -> Result<bool> {
        if self.numbers() > LONGEST {
            let problem = format!("is too long to be printed: expected at most {LONGEST} numbers, got {}", self.numbers());
            return Err(Error::input("motion", problem));
        }
        let mut print = PrintedMotion { source, name };
        let body = match self {
            Motion::Hold(_) => return Ok(false),
            Motion::Quintic(m) => print.rest_to_rest::<_, 3, 0>(m),
            Motion::BangBang(m) => print.rest_to_rest::<_, 3, 0>(m),
            Motion::Sinusoid(m) => print.sinusoid::<3, 0>(m),
            Motion::Table(m) => print.table(m),
            Motion::Spline(m) => print.spline::<3, 0>(m),
            Motion::TimedPath(m) => print.timed_path(m)?,
            Motion::Acceleration(of) => print.acceleration(of)?,
        };
        let text = format!("static void {}_{name}(double t, double *y)\n{{\n{body}}}\n\n", source.prefix());
        source.write(&text);
        Ok(true)
    }

    /// Describe the motion in one line.
    pub(super) fn described(&self) -> String {
        match self {
            Motion::Hold(_) => "a fixed target".into(),
            Motion::Quintic(m) => format!("a quintic from rest to rest in {} s", m.duration()),
            Motion::BangBang(m) => format!("a bang-bang motion from rest to rest in {} s", m.duration()),
            Motion::Sinusoid(_) => "a sum of sinusoids".into(),
            Motion::Table(m) => format!("a table from {} s on, every {} s", m.start(), m.dt()),
            Motion::Spline(m) => format!("a spline with {} knots", m.path().knots().len()),
            Motion::TimedPath(m) => format!("a path with a timing of {} s", m.duration()),
            Motion::Acceleration(of) => format!("the acceleration of {}", of.described()),
        }
    }
}

/// C code that appends `cosh w`, `sinh(w)/w` and `tanh(w/2)/w` with `w^2 = z` to six inputs. For `z < 0`, the functions are `cos w`,
/// `sin(w)/w` and `tan(w/2)/w` with `w^2 = -z`.
const WAVES: &str = "if (fabs(z) < 1e-3) {
    x[6] = 1.0 + z * (1.0 / 2.0 + z * (1.0 / 24.0 + z * (1.0 / 720.0 + z * (1.0 / 40320.0 + z / 3628800.0))));
    x[7] = 1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z / 362880.0)));
    x[8] = x[7] / (1.0 + x[6]);
} else if (z > 0.0) {
    const double w = sqrt(z);
    x[6] = cosh(w);
    x[7] = sinh(w) / w;
    x[8] = tanh(0.5 * w) / w;
} else {
    const double w = sqrt(-z);
    x[6] = cos(w);
    x[7] = sin(w) / w;
    x[8] = tan(0.5 * w) / w;
}
";

/// A motion during its output as C.
struct PrintedMotion<'a> {
    source: &'a mut CSource,
    name: &'a str,
}

impl PrintedMotion<'_> {
    /// Record a formula with this number of inputs and results, and add its C functions to the file. Return C code that calls them with the
    /// inputs `x`, and writes the results to `y`. Recorded operations are not simplified, so that they round as in [`Motion::sample`].
    fn formula(&mut self, part: &str, inputs: usize, results: usize, formula: impl FnOnce(&[Sym], &mut [Sym])) -> String {
        sym::begin_that(false);
        sym::end_set_up();
        let x: Vec<Sym> = (0..inputs).map(|_| sym::input()).collect();
        let mut y = vec![Sym::zero(); results];
        formula(&x, &mut y);
        let (recording, given) = (sym::finish(), vec![None; inputs]);
        let answer: Vec<u32> = y.iter().map(|y| y.index()).collect();
        let routine = Routine { ops: &recording.ops, given: &given, answer: &answer, fused: self.source.fused() };
        let sines = format!("{}_{}", self.source.prefix(), self.name);
        let (calls, slots) = self.source.routine_with_sines(&routine, &format!("{}_{part}", self.name), &sines);
        let work = if slots > 0 { format!("    double w[{slots}];\n") } else { String::new() };
        format!("{work}    int sound = 1;\n{calls}    (void)sound;\n")
    }

    /// The body for a motion whose formula changes at `breaks`, s. `formula` has the number of earlier breaks and the time as arguments.
    fn by_time(&mut self, breaks: &[f64], results: usize, formula: impl Fn(usize, Sym, &mut [Sym])) -> String {
        let mut text = "    const double x[1] = { t };\n    (void)x;\n    ".to_string();
        for piece in std::iter::once(0).chain((1..=breaks.len()).rev()) {
            let calls = self.formula(&format!("piece_{piece}"), 1, results, |x, y| formula(piece, x[0], y));
            text += &match piece {
                0 if breaks.is_empty() => format!("{{\n{}    }}\n", indented(&calls)),
                0 => format!("if (t < {}) {{\n{}    }} else ", hex(breaks[0]), indented(&calls)),
                1 => format!("{{\n{}    }}\n", indented(&calls)),
                piece => format!("if (t >= {}) {{\n{}    }} else ", hex(breaks[piece - 1]), indented(&calls)),
            };
        }
        text
    }

    fn rest_to_rest<P: Timing, const K: usize, const FROM: usize>(&mut self, motion: &RestToRest<P>) -> String {
        let n = motion.dof();
        self.by_time(&motion.breaks(), 3 * n, |piece, t, y| motion.on_piece::<_, K, FROM>(piece, t, y))
    }

    fn sinusoid<const K: usize, const FROM: usize>(&mut self, motion: &Sinusoid) -> String {
        let (n, prefix) = (motion.dof(), self.source.prefix().to_string());
        if motion.terms() > 0 {
            self.source.write(&format!(
                "static void {prefix}_{}_sin_cos(double angle, double *sine, double *cosine)\n{{\n    if (fabs(angle) < {}) {{\n        \
{prefix}_sin_cos(angle, sine, cosine);\n    }} else {{\n        *sine = sin(angle);\n        *cosine = cos(angle);\n    }}\n}}\n\n",
                self.name,
                hex(REDUCTION_LIMIT)
            ));
        }
        self.by_time(&[], 3 * n, |_, t, y| motion.evaluate::<_, K, FROM>(t, y))
    }

    fn table(&mut self, table: &Table) -> String {
        let (n, last) = (table.dof(), table.rows().len() / (3 * table.dof()) - 1);
        let (h, rate, width) = (table.dt(), 1.0 / table.dt(), 3 * n);
        // A table with one knot has no interval between knots.
        let (outside, between) = if last > 0 {
            let formula = |x: &[Sym], y: &mut [Sym]| table::between::<_, 3, 0>(n, x[0], [&x[1..], &x[1 + width..]], [h, rate], y);
            let calls = indented(&self.formula("between", 1 + 2 * width, width, formula));
            let x = format!("        double x[{}];\n        x[0] = u - (double)at;\n", 1 + 2 * width);
            let copy = format!("        memcpy(x + 1, rows + {width} * at, {} * sizeof(double));\n", 2 * width);
            (format!("if (!(u > 0.0 && u < {last}.0)) "), format!(" else {{\n        const long at = (long)u;\n{x}{copy}{calls}    }}"))
        } else {
            (String::new(), String::new())
        };
        let hold = indented(&indented(&print_hold(&format!("rows + (u > 0.0 ? {}L : 0L)", width * last), n)));
        format!(
            "{}    if (fabs(u - (double)k) < 1e-9) {{
        memcpy(y, rows + {width} * k, {width} * sizeof(double));
    }} else {outside}{{\n{hold}    }}{between}\n",
            print_nearest(table, last)
        )
    }

    /// The body for the acceleration of `motion`, which writes acceleration, jerk and snap.
    fn acceleration(&mut self, motion: &Motion) -> Result<String> {
        match motion {
            Motion::Quintic(m) => Ok(self.rest_to_rest::<_, 5, 2>(m)),
            Motion::Sinusoid(m) => Ok(self.sinusoid::<5, 2>(m)),
            Motion::Table(m) => Ok(self.table_acceleration(m)),
            Motion::Spline(m) => Ok(self.spline::<5, 2>(m)),
            _ => {
                let problem = "has no C of jerk and snap: expected a quintic, a sinusoid, a table or a spline, got";
                Err(Error::input("motion", format!("{problem} {}", motion.described())))
            }
        }
    }

    fn table_acceleration(&mut self, table: &Table) -> String {
        let (n, last) = (table.dof(), table.rows().len() / (3 * table.dof()) - 1);
        let (h, rate, width) = (table.dt(), 1.0 / table.dt(), 3 * n);
        let between = if last > 0 {
            let formula = |x: &[Sym], y: &mut [Sym]| table::between::<_, 5, 2>(n, x[0], [&x[1..], &x[1 + width..]], [h, rate], y);
            let calls = indented(&self.formula("between", 1 + 2 * width, width, formula));
            format!(
                "    if (on || (u > 0.0 && u < {last}.0)) {{
        const long at = !on ? (long)u : k < {last}L ? k : {last}L - 1L;
        double x[{}];
        x[0] = u - (double)at;
        memcpy(x + 1, rows + {width} * at, {} * sizeof(double));\n{calls}    }}\n",
                1 + 2 * width,
                2 * width
            )
        } else {
            String::new()
        };
        let near = print_nearest(table, last);
        format!("{near}    const int on = fabs(u - (double)k) < 1e-9;\n    memset(y, 0, {width} * sizeof(double));\n{between}")
            + &format!("    if (on)\n        memcpy(y, rows + {width} * k + {}, {n} * sizeof(double));\n", 2 * n)
    }

    fn spline<const K: usize, const FROM: usize>(&mut self, motion: &Spline) -> String {
        let (path, n, last) = (motion.path(), motion.dof(), motion.path().knots().len() - 1);
        let (start, end) = path.ends();
        let calls = self.formula("piece", 3 + 6 * n, 3 * n, |x, y| {
            path::on_piece(n, [x[1], x[2]], &x[3..], x[0], |j, q| put::<_, K, FROM>(n, y, j, q));
        });
        let hold =
            if FROM == 0 { print_hold("t > knot[0] ? end : start", n) } else { format!("memset(y, 0, {} * sizeof(double));\n", 3 * n) };
        // A motion that stops rests from the last knot on, and another one after it.
        let inside = if motion.stops() { "<" } else { "<=" };
        let exact = if FROM == 0 && !motion.stops() {
            format!("    if (t == knot[{last}])\n        memcpy(y, end, {n} * sizeof(double));\n")
        } else {
            String::new()
        };
        let ends = if FROM == 0 { array("start", start) + &array("end", end) } else { String::new() };
        ends + &array("knot", path.knots())
            + &array("coefficient", path.coefficients())
            + &format!("    double x[{}];\n    int low, high;\n", 3 + 6 * n)
            + &format!("    if (!(t >= knot[0] && t {inside} knot[{last}])) {{\n{}        return;\n    }}\n", indented(&indented(&hold)))
            + &indented(&search("knot", "t", last))
            + &format!(
                "    x[0] = t;\n    memcpy(x + 1, knot + low, 2 * sizeof(double));\n    memcpy(x + 3, coefficient + {0} * low, {0} * sizeof(double));\n",
                6 * n
            )
            + &calls
            + &exact
    }

    fn timed_path(&mut self, motion: &TimedPath) -> Result<String> {
        let (path, last, n) = (motion.path(), motion.grid().len() - 1, motion.dof());
        let all = [motion.grid(), motion.squared_speeds(), motion.times(), motion.acceleration_slopes(), motion.node_accelerations()];
        if all.iter().any(|values| values.iter().any(|x| x.is_nan())) {
            return Err(Error::input("motion", "has no timing: expected a path that is feasible, got one that is not"));
        }
        let (start, end) = path.ends();
        let ends = array("start", start) + &array("end", end);
        let hold = print_hold("t > 0.0 ? end : start", n);
        if motion.duration() == 0.0 {
            return Ok(ends + &indented(&hold));
        }
        let rates: Vec<f64> = motion.squared_speeds().iter().map(|x| x.sqrt()).collect();
        let (phase_tables, phase) = self.phase(motion);
        let (piece_table, piece) = if motion.pieces().is_empty() {
            (String::new(), search("knot", "phase[0]", path.knots().len() - 1) + "p = low;\n")
        } else {
            let pieces: Vec<String> = motion.pieces().iter().map(usize::to_string).collect();
            (format!("    static const int piece[{last}] = {{ {} }};\n", pieces.join(", ")), "p = piece[i];\n".into())
        };
        let calls = self.formula("along", 5 + 6 * n, 3 * n, |x, y| {
            let timing = [x[0], x[1], x[2], Sym::zero(), Sym::zero()];
            path::on_piece(n, [x[3], x[4]], &x[5..], x[0], |j, q| put::<_, 3, 0>(n, y, j, chain(q, timing)));
        });
        Ok([ends, array("s_at", motion.grid()), array("rate_at", &rates), array("t_at", motion.times())].concat()
            + &array("knot", path.knots())
            + &array("coefficient", path.coefficients())
            + &phase_tables
            + &piece_table
            + &format!("    double phase[3], x[{}];\n    int i = {last} - 1, p, low, high;\n", 5 + 6 * n)
            + &format!("    if (!(t >= 0.0 && t <= t_at[{last}])) {{\n{}        return;\n    }}\n", indented(&indented(&hold)))
            + &format!("    if (t == t_at[{last}]) {{\n        phase[0] = s_at[{last}];\n        phase[1] = rate_at[{last}];\n        ")
            + &format!("phase[2] = {};\n    }} else {{\n", hex(motion.end_acceleration()))
            + &indented(&indented(&(search("t_at", "t", last) + "i = low;\n{\n" + &indented(&phase) + "}\n")))
            + &format!("    }}\n{}    memcpy(x, phase, sizeof phase);\n", indented(&piece))
            + &format!(
                "    memcpy(x + 3, knot + p, 2 * sizeof(double));\n    memcpy(x + 5, coefficient + {0} * p, {0} * sizeof(double));\n",
                6 * n
            )
            + &calls
            + &format!("    (void)i;\n    if (phase[0] == s_at[{last}])\n        memcpy(y, end, {n} * sizeof(double));\n"))
    }

    /// The tables of the timing, and C code that writes path position, path speed and path acceleration in segment `i` to `phase`.
    fn phase(&mut self, motion: &TimedPath) -> (String, String) {
        let (grid, last) = (motion.grid(), motion.grid().len() - 1);
        let head = "const double d = t - t_at[i]";
        if !motion.node_accelerations().is_empty() {
            let ends = [grid[0], grid[last]];
            let calls = self.formula("phase", 5, 3, |x, y| {
                y.copy_from_slice(&timed_path::linear_in_time(x[0], [x[1], x[2], x[3], x[4]], ends.map(Sym::splat))[..3]);
            });
            let jolt = "(u_at[i + 1] - u_at[i]) / (t_at[i + 1] - t_at[i])";
            let x = format!("const double x[5] = {{ d, s_at[i], rate_at[i], u_at[i], {jolt} }};\ndouble *y = phase;\n");
            return (array("u_at", motion.node_accelerations()), format!("{head};\n{x}{calls}"));
        }
        let calls = self.formula("phase", 9, 3, |x, y| {
            y.copy_from_slice(&timed_path::linear_in_position(x[0], [x[1], x[2], x[3], x[4]], [x[6], x[7], x[8]], x[5])[..3]);
        });
        let starts: Vec<f64> = (0..last).map(|i| motion.end_accelerations(i).0).collect();
        let x = "double x[9] = { d, s_at[i], rate_at[i], u_at[i], slope[i], s_at[i + 1], 0.0, 0.0, 0.0 }, *y = phase;\n";
        let tables = array("u_at", &starts) + &array("slope", motion.acceleration_slopes());
        (tables, format!("{head}, z = slope[i] * d * d;\n{x}{WAVES}{calls}"))
    }
}
