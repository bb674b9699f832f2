//! Motions as C code: functions of time with the operations of [`Motion::sample`]. The results of the C code and of armlet have equal bits
//! under two conditions. The C compiler must fuse nothing but calls of `fma()`. The mathematical functions that are called must come from
//! the same C library.

use super::{BangBang, Motion, Quintic, Sinusoid, Table, TimedPath};
use crate::error::{Error, Result};
use crate::scalar::hex::hex;
use crate::scalar::trig::REDUCTION_LIMIT;

/// Largest number of values in a printed motion.
const LONGEST: usize = 1 << 20;

/// Number of values on a line.
const WIDE: usize = 6;

/// The C expression of `a b + c` for the expressions `a`, `b` and `c`.
type MultiplyAdd<'a> = dyn Fn(&str, &str, &str) -> String + 'a;

/// Print a constant array of hexadecimal numbers.
pub(crate) fn array(name: &str, values: &[f64]) -> String {
    let lines: Vec<String> = values.chunks(WIDE).map(|row| row.iter().map(|&x| hex(x)).collect::<Vec<_>>().join(", ")).collect();
    format!("    static const double {name}[{}] = {{\n        {}\n    }};\n", values.len(), lines.join(",\n        "))
}

fn constant(name: &str, value: f64) -> String {
    format!("    const double {name} = {};\n", hex(value))
}

impl Motion {
    /// Print the C function `static void name(double t, double *out)`, which writes `[q_d, v_d, a_d]`; `None` for a motion that holds its
    /// position. `sin_cos` names a C function for sines and cosines. `multiply_add(a, b, c)` is the C expression of `a b + c`.
    pub(crate) fn print_c(&self, name: &str, sin_cos: &str, multiply_add: &MultiplyAdd) -> Result<Option<String>> {
        if self.numbers() > LONGEST {
            let problem = format!("is too long to be printed: expected at most {LONGEST} numbers, got {}", self.numbers());
            return Err(Error::input("motion", problem));
        }
        let body = match self {
            Motion::Hold(_) => return Ok(None),
            Motion::Quintic(m) => m.print_c(),
            Motion::BangBang(m) => m.print_c(),
            Motion::Sinusoid(m) => m.print_c(sin_cos, multiply_add),
            Motion::Table(m) => m.print_c(),
            Motion::TimedPath(m) => m.print_c()?,
        };
        Ok(Some(format!("static void {name}(double t, double *out)\n{{\n{body}}}\n\n")))
    }

    /// Describe the motion in one line.
    pub(crate) fn described(&self) -> String {
        match self {
            Motion::Hold(_) => "a fixed target".into(),
            Motion::Quintic(m) => format!("a quintic from rest to rest in {} s", m.duration()),
            Motion::BangBang(m) => format!("a bang-bang motion from rest to rest in {} s", m.duration()),
            Motion::Sinusoid(_) => "a sum of sinusoids".into(),
            Motion::Table(m) => format!("a table from {} s on, every {} s", m.start(), m.dt()),
            Motion::TimedPath(m) => format!("a path with a timing of {} s", m.duration()),
        }
    }
}

/// C code that writes `[q_d, v_d, a_d]` to `out`. It reads the timing `s`, which increases from 0 to 1, its rate `ds` and its acceleration
/// `dds`.
const ALONG: &str = "    for (i = 0; i < N; i++) {
        const double d = q1[i] - q0[i];
        out[i] = s == 1.0 ? q1[i] : q0[i] + d * s;
        out[N + i] = d * ds;
        out[2 * N + i] = d * dds;
    }
";

fn rest_to_rest((q0, q1): (&[f64], &[f64]), duration: f64, timing: &str) -> String {
    let head = array("q0", q0) + &array("q1", q1) + &constant("duration", duration) + &constant("rate", 1.0 / duration);
    format!("{head}    double s = 0.0, ds = 0.0, dds = 0.0;\n    int i;\n{timing}{}", ALONG.replace('N', &q0.len().to_string()))
}

impl Quintic {
    fn print_c(&self) -> String {
        let timing = "    if (t >= duration) {
        s = 1.0;
    } else if (t > 0.0) {
        const double x = t * rate, y = 1.0 - x;
        s = x * x * x * (10.0 + x * (6.0 * x - 15.0));
        ds = 30.0 * (x * y) * (x * y) * rate;
        dds = 60.0 * x * y * (y - x) * rate * rate;
    }
";
        rest_to_rest(self.ends(), self.duration(), timing)
    }
}

impl BangBang {
    fn print_c(&self) -> String {
        let timing = "    if (t >= duration) {
        s = 1.0;
    } else if (t >= 0.0 && t < 0.5 * duration) {
        const double x = t * rate;
        s = 2.0 * x * x;
        ds = 4.0 * x * rate;
        dds = 4.0 * rate * rate;
    } else if (t >= 0.0) {
        const double y = (duration - t) * rate;
        s = 1.0 - 2.0 * y * y;
        ds = 4.0 * y * rate;
        dds = -4.0 * rate * rate;
    }
";
        rest_to_rest(self.ends(), self.duration(), timing)
    }
}

impl Sinusoid {
    fn print_c(&self, sin_cos: &str, multiply_add: &MultiplyAdd) -> String {
        let (offset, [amplitude, frequency, phase]) = self.parts();
        let (n, terms) = (offset.len(), amplitude.len() / offset.len());
        let products =
            |power: i32| -> Vec<f64> { amplitude.iter().zip(frequency).map(|(a, w)| if power == 1 { a * w } else { a * w * w }).collect() };
        let mut text = array("offset", offset);
        if terms == 0 {
            return format!(
                "{text}    int i;\n    (void)t;\n    for (i = 0; i < {n}; i++) {{\n        out[i] = offset[i];\n        \
out[{n} + i] = out[{} + i] = 0.0;\n    }}\n",
                2 * n
            );
        }
        text += &(array("amplitude", amplitude) + &array("frequency", frequency) + &array("phase", phase));
        text += &(array("first", &products(1)) + &array("second", &products(2)));
        format!(
            "{text}    int i, k;
    for (i = 0; i < {n}; i++) {{
        double q = offset[i], v = 0.0, a = 0.0;
        for (k = {terms} * i; k < {terms} * (i + 1); k++) {{
            const double angle = frequency[k] * t + phase[k];
            double sine, cosine;
            if (fabs(angle) < {})
                {sin_cos}(angle, &sine, &cosine);
            else {{
                sine = sin(angle);
                cosine = cos(angle);
            }}
            q = {};
            v = {};
            a = {};
        }}
        out[i] = q;
        out[{n} + i] = v;
        out[{} + i] = a;
    }}
",
            hex(REDUCTION_LIMIT),
            multiply_add("amplitude[k]", "sine", "q"),
            multiply_add("first[k]", "cosine", "v"),
            multiply_add("-second[k]", "sine", "a"),
            2 * n
        )
    }
}

/// C code for a time at a knot of a table, or outside of the table.
const KNOTS: &str = "    const double u = (t - start) * rate, near = u + 0.5;
    const long k = !(near > 0.0) ? 0L : near >= LAST.0 ? LASTL : (long)near;
    int i;
    if (fabs(u - (double)k) < 1e-9) {
        memcpy(out, rows + WIDTH * k, WIDTH * sizeof(double));
    } else if (!(u > 0.0 && u < LAST.0)) {
        const double *p = rows + (u > 0.0 ? WIDTH * LASTL : 0L);
        for (i = 0; i < N; i++) {
            out[i] = p[i];
            out[N + i] = out[2 * N + i] = 0.0;
        }
    }";

/// C code for a time between two knots of a table.
const BETWEEN: &str = " else {
        const long at = (long)u;
        const double *p = rows + WIDTH * at, *r = p + WIDTH, x = u - (double)at;
        for (i = 0; i < N; i++) {
            const double c0 = p[i], c1 = h * p[N + i], c2 = 0.5 * h * h * p[2 * N + i];
            const double dq = r[i] - c0 - c1 - c2;
            const double dv = h * r[N + i] - c1 - 2.0 * c2;
            const double da = h * h * r[2 * N + i] - 2.0 * c2;
            const double c3 = 10.0 * dq - 4.0 * dv + 0.5 * da;
            const double c4 = -15.0 * dq + 7.0 * dv - da;
            const double c5 = 6.0 * dq - 3.0 * dv + 0.5 * da;
            out[i] = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))));
            out[N + i] = rate * (c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5))));
            out[2 * N + i] = rate * rate * (2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5)));
        }
    }";

impl Table {
    fn print_c(&self) -> String {
        let (n, last) = (self.dof(), self.rows().len() / (3 * self.dof()) - 1);
        let mut head = array("rows", self.rows()) + &constant("start", self.start()) + &constant("rate", 1.0 / self.dt());
        let mut body = KNOTS.to_string();
        // A table with one knot has no interval between knots.
        if last > 0 {
            head += &constant("h", self.dt());
            body += BETWEEN;
        } else {
            body = body.replace("else if (!(u > 0.0 && u < LAST.0))", "else");
        }
        head + &body.replace("LAST", &last.to_string()).replace("WIDTH", &(3 * n).to_string()).replace('N', &n.to_string()) + "\n"
    }
}

/// C code for `cosh w`, `sinh(w)/w` and `tanh(w/2)/w` with `w^2 = z`. For `z < 0`, the functions are `cos w`, `sin(w)/w` and `tan(w/2)/w`
/// with `w^2 = -z`. The code calls the C library.
const WAVES: &str = "        double wave_c, wave_s, wave_t;
        if (fabs(z) < 1e-3) {
            wave_c = 1.0 + z * (1.0 / 2.0 + z * (1.0 / 24.0 + z * (1.0 / 720.0 + z * (1.0 / 40320.0 + z / 3628800.0))));
            wave_s = 1.0 + z * (1.0 / 6.0 + z * (1.0 / 120.0 + z * (1.0 / 5040.0 + z / 362880.0)));
            wave_t = wave_s / (1.0 + wave_c);
        } else if (z > 0.0) {
            const double w = sqrt(z);
            wave_c = cosh(w);
            wave_s = sinh(w) / w;
            wave_t = tanh(0.5 * w) / w;
        } else {
            const double w = sqrt(-z);
            wave_c = cos(w);
            wave_s = sin(w) / w;
            wave_t = tan(0.5 * w) / w;
        }
";

impl TimedPath {
    fn print_c(&self) -> Result<String> {
        let (path, last) = (self.path(), self.grid().len() - 1);
        let all = [self.grid(), self.squared_speeds(), self.times(), self.acceleration_slopes(), self.node_accelerations()];
        if all.iter().any(|values| values.iter().any(|x| x.is_nan())) {
            return Err(Error::input("motion", "has no timing: expected a path that is feasible, got one that is not"));
        }
        let (n, cubic, still) = (path.dof(), !self.node_accelerations().is_empty(), self.duration() == 0.0);
        let (start, end) = path.ends();
        let mut text = array("start", start) + &array("end", end);
        if still {
            return Ok(format!(
                "{text}    const double *hold = t > 0.0 ? end : start;\n    int j;\n    for (j = 0; j < {n}; j++) {{\n        \
out[j] = hold[j];\n        out[{n} + j] = out[{} + j] = 0.0;\n    }}\n",
                2 * n
            ));
        }
        let rates: Vec<f64> = self.squared_speeds().iter().map(|x| x.sqrt()).collect();
        text += &(array("s_at", self.grid()) + &array("rate_at", &rates) + &array("t_at", self.times()));
        text += &(array("knot", path.knots()) + &array("coefficient", path.coefficients()));
        let last_u = if self.squared_speeds()[last] == 0.0 || cubic { 0.0 } else { self.end_accelerations(last - 1).1 };
        let (phase, piece) = (self.print_phase(&mut text), self.print_piece(&mut text));
        let body = format!(
            "    double s, rate, u, x, scale;\n    const double *c;\n    int i, j, p, low = 0, high = LAST;
    if (!(t >= 0.0 && t <= t_at[LAST])) {{
        const double *hold = t > 0.0 ? end : start;
        for (j = 0; j < N; j++) {{
            out[j] = hold[j];
            out[N + j] = out[2 * N + j] = 0.0;
        }}
        return;
    }}
    if (t == t_at[LAST]) {{
        i = LAST - 1;
        s = s_at[LAST];
        rate = rate_at[LAST];
        u = {};
    }} else {{
        while (high - low > 1) {{
            const int middle = (low + high) / 2;
            if (t_at[middle] <= t) low = middle; else high = middle;
        }}
        i = low;
        {{
{phase}        }}
        rate = rate > 0.0 ? rate : 0.0;
    }}
{piece}    (void)i;
    scale = 1.0 / (knot[p + 1] - knot[p]);
    x = (s - knot[p]) * scale;
    c = coefficient + 6 * N * p;
    for (j = 0; j < N; j++) {{
        const double c0 = c[j], c1 = c[N + j], c2 = c[2 * N + j], c3 = c[3 * N + j], c4 = c[4 * N + j], c5 = c[5 * N + j];
        const double d = (c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * (5.0 * c5))))) * scale;
        const double e = (2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * (20.0 * c5)))) * scale * scale;
        out[j] = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))));
        out[N + j] = d * rate;
        out[2 * N + j] = d * u + e * rate * rate;
    }}
    if (s == s_at[LAST])
        memcpy(out, end, N * sizeof(double));
",
            hex(last_u)
        );
        let body = body.replace("LAST", &last.to_string()).replace("PIECES", &(path.knots().len() - 1).to_string());
        Ok(text + &body.replace('N', &n.to_string()))
    }

    /// Print the C code for `s` and its first two derivatives within an interval of the grid. The tables of the grid are appended to `text`.
    fn print_phase(&self, text: &mut String) -> String {
        if !self.node_accelerations().is_empty() {
            *text += &array("u_at", self.node_accelerations());
            "        const double d = t - t_at[i], u0 = u_at[i], jolt = (u_at[i + 1] - u_at[i]) / (t_at[i + 1] - t_at[i]);
        const double on = d * (rate_at[i] + d * (u0 / 2.0 + d * jolt / 6.0));
        s = s_at[i] + on;
        s = s < s_at[0] ? s_at[0] : s > s_at[LAST] ? s_at[LAST] : s;
        rate = rate_at[i] + d * (u0 + d * jolt / 2.0);
        u = u0 + d * jolt;
"
            .to_string()
        } else {
            let starts: Vec<f64> = (0..self.grid().len() - 1).map(|i| self.end_accelerations(i).0).collect();
            *text += &(array("u_at", &starts) + &array("slope", self.acceleration_slopes()));
            format!(
                "        const double d = t - t_at[i], b = slope[i], z = b * d * d;\n        double on;\n{WAVES}\
        rate = rate_at[i] * wave_c + u_at[i] * d * wave_s;
        rate = rate > 0.0 ? rate : 0.0;
        on = (rate_at[i] + rate) * d * wave_t;
        s = s_at[i] + on;
        s = s < s_at[i] ? s_at[i] : s > s_at[i + 1] ? s_at[i + 1] : s;
        u = u_at[i] + b * on;
"
            )
        }
    }

    /// Print the C code that finds the piece of the path at `s`. Its table, if there is one, is appended to `text`.
    fn print_piece(&self, text: &mut String) -> String {
        if self.pieces().is_empty() {
            "    low = 0;\n    high = PIECES;\n    while (high - low > 1) {\n        const int middle = (low + high) / 2;\n        \
if (knot[middle] <= s) low = middle; else high = middle;\n    }\n    p = low;\n"
                .to_string()
        } else {
            let pieces: Vec<String> = self.pieces().iter().map(usize::to_string).collect();
            *text += &format!("    static const int piece[{}] = {{ {} }};\n", pieces.len(), pieces.join(", "));
            "    p = piece[i];\n".to_string()
        }
    }
}
