//! Writes the NEON programs (recorded machine code) of five loops, which `make test-aarch64` runs in an emulator.

use crate::counting::counted;
use crate::harness::{self, Cases};
use armlet_core::arm::{Arm, STANDARD_GRAVITY, example_urdf};
use armlet_core::dynamics::{Model, PlanarPr};
use armlet_core::law::{
    Adaptation, AdaptiveSpec, CartesianImpedanceSpec, ComputedTorqueSpec, ElasticImpedanceSpec, Gain, LawSpec, ReductionSpec,
};
use armlet_core::motion::{Motion, Sinusoid};
use armlet_core::plant::{ElasticSpec, PlantSpec, RigidSpec};
use armlet_core::simulate::{Options, Problem, watch_steps};
use armlet_core::trace::aarch64::Assembler;
use armlet_core::trace::emit::emit;
use armlet_core::trace::instruction::{Form, Set};
use armlet_core::trace::listing::Lowered;
use armlet_core::trace::straight::{Straight, Stream};
use armlet_core::trace::{Engine, Frame, Part, Program, Scratch};
use std::sync::Arc;

const STEP: f64 = 1e-3;
/// The number of iterations of a program that reads new inputs in every iteration.
const TURNS: usize = 3;

fn gain(n: usize, k: f64) -> Gain {
    Gain::scalar("gain", n, k).unwrap()
}

fn arm(name: &str) -> Arm {
    Arm::from_urdf(example_urdf(name).unwrap(), name, STANDARD_GRAVITY, None, None).unwrap()
}

fn sinusoid(n: usize) -> Motion {
    let each = |x: f64| (0..n).map(|i| x + 0.1 * i as f64).collect::<Vec<f64>>();
    Motion::Sinusoid(Sinusoid::new(each(0.1), 1, each(0.2), each(1.1), each(0.3)).unwrap())
}

fn adaptive(model: &Model) -> LawSpec {
    let (n, p) = (model.n(), model.parameter_count());
    let (motion, gamma) = (sinusoid(n), Adaptation::Euclidean(gain(p, 0.2)));
    LawSpec::Adaptive(AdaptiveSpec::new(model.clone(), motion, gain(n, 40.0), gain(n, 20.0), gamma, None, None).unwrap())
}

/// Return a Cartesian impedance law for the position of the tip.
fn impedance(model: &Model, frame: &str) -> CartesianImpedanceSpec {
    let target = Motion::hold(vec![0.4, 0.2, 0.5]).unwrap();
    CartesianImpedanceSpec::new(model.clone(), target, gain(3, 300.0), gain(3, 60.0), frame, "xyz").unwrap()
}

/// Return five loops: PR adaptive, planar 4R computed torque, six-axis impedance, seven-axis adaptive, seven-axis elastic impedance.
fn loops() -> Vec<(PlantSpec, LawSpec)> {
    let of = |name: &str| (Model::Tree(Arc::new(arm(name))), arm(name).frame_names().last().unwrap().to_owned());
    let rigid = |model: &Model| PlantSpec::Rigid(RigidSpec::new(model.clone()));
    let pr = Model::PlanarPr(PlanarPr::new(2.0, 0.5, 0.7).unwrap());
    let four = Model::Tree(Arc::new(Arm::planar(&[0.4; 4], None, None, None, [0.0, -9.81]).unwrap()));
    let ((six, wrist), (seven, tip)) = (of("six_axis"), of("seven_axis"));
    let torque = ComputedTorqueSpec::new(four.clone(), sinusoid(4), gain(4, 100.0), gain(4, 20.0)).unwrap();
    let (springs, motors) = (gain(7, 800.0), gain(7, 0.4));
    let elastic = ElasticSpec::new(seven.clone(), springs.clone(), motors.clone(), None, None, None).unwrap();
    let inner = ReductionSpec::new(7, springs, motors, gain(7, 0.02), None, 1.0, false).unwrap();
    let soft = LawSpec::ElasticImpedance(ElasticImpedanceSpec { outer: impedance(&seven, &tip), inner });
    vec![
        (rigid(&pr), adaptive(&pr)),
        (rigid(&four), LawSpec::ComputedTorque(torque)),
        (rigid(&six), LawSpec::CartesianImpedance(impedance(&six, &wrist))),
        (rigid(&seven), adaptive(&seven)),
        (PlantSpec::Elastic(elastic), soft),
    ]
}

fn options() -> Options {
    Options { monitors: false, ..Options::fixed(STEP, STEP) }
}

/// Return a number between -1 and 1, which is neither zero nor one in magnitude.
fn number(k: usize) -> f64 {
    (0.7 * k as f64 + 0.3).sin()
}

/// Add a program to the cases. Its frame (the memory of the program) starts with `inputs`. The emulator must reproduce the result of
/// the interpreter of the recorded operations.
fn add(cases: &mut Cases, (part, program, scratch): (Part, &Straight, Scratch), form: Form, inputs: &[f64]) {
    let interpreter = Program::new(part, program.stream, scratch, form, Engine::Interpreter);
    let emitted = emit::<Assembler>(program, form, scratch.free);
    let [mut frame, mut expected] = [emitted.slots, interpreter.slots()].map(|slots| Frame::new(slots.max(scratch.free), form.lanes()));
    interpreter.prepare(&mut expected);
    [&mut frame, &mut expected].into_iter().for_each(|frame| frame.numbers_mut()[..inputs.len()].copy_from_slice(inputs));
    let turns = if program.stream.is_some() { TURNS } else { 1 };
    let width = if program.stream.is_some_and(|stream| stream.spread) { 1 } else { form.lanes() };
    let mut desired = Frame::new(program.stream.map_or(0, |stream| stream.slots(turns)), width);
    desired.numbers_mut().iter_mut().enumerate().for_each(|(k, x)| *x = number(k));
    let ((), allocations) = counted(|| match program.stream {
        None => interpreter.run(&mut expected),
        Some(_) => interpreter.run_along(&mut expected, desired.numbers(), turns),
    });
    assert_eq!(allocations, 0, "the interpreter does not allocate");
    if let Some(Stream { first, count, .. }) = program.stream {
        // The machine code does not write to these slots.
        (first..first + count).for_each(|slot| [&mut frame, &mut expected].into_iter().for_each(|frame| frame.fill(slot as usize, 0.0)));
    }
    let expected = &expected.numbers()[..scratch.free * form.lanes()];
    assert!(expected.iter().all(|x| x.is_finite()), "the numbers of a loop are finite");
    cases.add(&emitted.bytes, frame.numbers(), &emitted.constants, (desired.numbers(), turns), expected);
}

/// Write every program of every loop, for one run and for lanes.
#[test]
fn loops_are_written_for_the_emulator() {
    let (mut cases, mut spilling) = (Cases::default(), 0);
    for (plant, law) in &loops() {
        let x0 = vec![0.0; plant.states()];
        let problem =
            Problem { plants: vec![plant], laws: vec![law], x0, forces: Vec::new(), force_frame: None, options: options(), measures: None };
        for packed in [false, true] {
            let form = Form { set: Set::Neon, packed };
            let (given, step) = watch_steps(&problem, packed, &mut |_, _, _, _, _| ());
            let mut each = |_: String, part: Part, stream: Option<Stream>, scratch: Scratch, _: bool| {
                let program = Lowered::of(part, stream, scratch, form).straight;
                let mut inputs: Vec<f64> = (0..scratch.free * form.lanes()).map(number).collect();
                for (slot, lanes) in inputs.chunks_exact_mut(form.lanes()).enumerate() {
                    match given.get(slot) {
                        Some(&x) => lanes.fill(x),
                        None if slot == step => lanes.fill(STEP),
                        None if slot == scratch.reach as usize => lanes.fill(0.0),
                        None => {}
                    }
                }
                spilling += usize::from(emit::<Assembler>(&program, form, scratch.free).spilled > 0);
                add(&mut cases, (part, &program, scratch), form, &inputs);
            };
            watch_steps(&problem, packed, &mut each);
        }
    }
    assert!(cases.len() >= 40 && spilling >= 10, "{} programs, {spilling} of them spill", cases.len());
    harness::write("loops.s", &cases.finish());
}
