//! Tests of contacts and events in runs. A held contact keeps its state (apart, pressed or slack) until an event changes it. Until then,
//! its force must equal the force of a contact without a held state. A stop must be reached at the expected time. The energy balance must
//! be zero through a damped stop.

use armlet_core::arm::Arm;
use armlet_core::dynamics::Model;
use armlet_core::law::{ComputedTorqueSpec, Gain, LawSpec};
use armlet_core::motion::Motion;
use armlet_core::plant::unilateral::push;
use armlet_core::plant::{PlantSpec, RigidSpec, Stop, Stops, Touch};
use armlet_core::simulate::{
    DEFAULT_STATE_LIMIT, Event, EventFunction, Method, Options, Polynomials, Problem, Run, RunObserver, Times, simulate_observed,
};
use armlet_core::status::Status;
use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

#[test]
fn held_contacts_agree_with_free_ones_where_they_hold() {
    for (depth, rate) in [(-0.1, 3.0), (0.0, 0.0), (0.1, 2.0), (0.1, -2.0), (0.1, -0.5), (1e-300, 1.0)] {
        let force = 100.0 * depth + 20.0 * rate;
        let touch = Touch::at(depth, force);
        assert_eq!(push(100.0, 20.0, depth, rate, Some(touch.into())), push(100.0, 20.0, depth, rate, None), "{depth} {rate} {touch:?}");
        assert!(touch.guards(depth, force).iter().all(|&guard| guard >= 0.0));
    }
}

#[test]
fn a_contact_is_entered_pressed_and_left_slack() {
    assert_eq!(Touch::Apart.next(0, 0.0), Touch::Pressed);
    // With a damper, the contact separates before the surface is reached. With a spring alone, it separates at the surface.
    assert_eq!(Touch::Pressed.next(0, 0.01), Touch::Slack);
    assert_eq!(Touch::Pressed.next(0, 0.0), Touch::Apart);
    assert_eq!(Touch::Slack.next(0, 0.0), Touch::Apart);
    assert_eq!(Touch::Slack.next(1, 0.01), Touch::Pressed);
}

#[test]
fn stops_say_what_they_lack() {
    let stops = |lower: f64, upper: f64, k: f64, c: f64| Stops::new(vec![lower], vec![upper], vec![k], vec![c]);
    let free = f64::INFINITY;
    assert!(stops(-1.0, 1.0, 1e3, 0.0).is_ok() && stops(-free, 1.0, 1e3, 0.0).is_ok());
    for bad in [stops(-free, free, 1e3, 0.0), stops(1.0, 1.0, 1e3, 0.0), stops(-1.0, f64::NAN, 1e3, 0.0)] {
        assert!(bad.is_err());
    }
    assert!(stops(-1.0, 1.0, 0.0, 0.0).is_err() && stops(-1.0, 1.0, 1e3, -1.0).is_err());
    let one = stops(-free, 1.0, 1e3, 0.0).unwrap();
    assert_eq!(one.all().collect::<Vec<_>>(), [Stop { joint: 0, upper: true }]);
    assert_eq!((one.energy(&[1.1]), one.energy(&[0.9])), (0.5 * 1e3 * (1.1f64 - 1.0) * (1.1 - 1.0), 0.0));
}

/// Return a run of a link of 1 kg m^2 without a drive, which moves at 2 rad/s towards a stop at 1 rad.
fn thrown(damping: f64, method: Method, observer: Option<&mut RunObserver>) -> Run {
    let model = Model::Tree(Arc::new(Arm::pendulum(1.0, 0.0).unwrap()));
    let stops = Stops::new(vec![f64::NEG_INFINITY], vec![1.0], vec![400.0], vec![damping]).unwrap();
    let plant = PlantSpec::Rigid(RigidSpec { stops: Some(stops), ..RigidSpec::new(model.clone()) });
    let still = Gain::scalar("gain", 1, 1e-12).unwrap();
    let law = LawSpec::ComputedTorque(ComputedTorqueSpec::new(model, Motion::Hold(vec![0.0]), still.clone(), still).unwrap());
    let options = Options {
        t_end: 1.0,
        dt: None,
        method,
        rtol: 1e-10,
        atol: 1e-12,
        max_step: None,
        sampling: None,
        times: Times::Every(1),
        tau_max: None,
        monitors: true,
        state_limit: DEFAULT_STATE_LIMIT,
    };
    let x0 = plant.initial_state(&[0.0], &[2.0], None, None);
    let problem = Problem { plants: vec![&plant], laws: vec![&law], x0, forces: Vec::new(), force_frame: None, options, measures: None };
    simulate_observed(&problem, &AtomicBool::new(false), observer).unwrap()
}

const ADAPTIVE: [Method; 4] = [Method::Dopri5, Method::Dop853, Method::Radau5, Method::Rodas4];

#[test]
fn a_stop_is_met_and_left_when_it_should_be() {
    for method in ADAPTIVE {
        let event = |function| Event { function, direction: 0.0, stop_after: 0 };
        let events =
            vec![event(EventFunction::Joint { joint: 0, value: 1.0, below: false }), event(EventFunction::Speed { at: 1, value: 0.0 })];
        let mut observer = RunObserver { events, polynomials: Some(Polynomials::default()), ..RunObserver::default() };
        let run = thrown(0.0, method, Some(&mut observer));
        assert_eq!(run.status, Status::Success, "{method:?}");
        // With the speed 2 rad/s and sqrt(k/I) = 20 rad/s, the contact begins at 1/2 s. The reversal is a quarter period later, and the
        // separation half a period later.
        let expected = [0.5, 0.5 + PI / 40.0, 0.5 + PI / 20.0];
        assert_eq!(observer.crossings.index, [0, 1, 0], "{method:?}");
        for (t, want) in observer.crossings.t.iter().zip(expected) {
            // The tolerance is the error of the run. The error of the root search is one ulp.
            assert!((t - want).abs() < 1e-8, "{method:?}: {t} {want}");
        }
        // The steps must have no gaps: each begins where the previous one ended. One step must end at the stop.
        let ends = observer.polynomials.unwrap().ends;
        assert!(ends.windows(2).all(|pair| pair[0] < pair[1]) && ends.last() == Some(&1.0));
        assert!(ends.iter().any(|&t| t == observer.crossings.t[0]), "{method:?}");
    }
}

#[test]
fn the_balance_holds_through_a_damped_stop() {
    for method in ADAPTIVE {
        let run = thrown(8.0, method, None);
        let (_, balance) = run.monitors.iter().find(|(name, _)| *name == "energy_balance").unwrap();
        let worst = balance.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        // The link exchanges 2 J with the stop. The step-size control considers only the state, and not the energy integrals.
        assert!(worst < 2e-8, "{method:?}: {worst}");
        assert!(run.v.last().unwrap() < &-1.0 && run.v.last().unwrap() > &-1.9, "the damper took its part: {:?}", run.v.last());
    }
}

#[test]
fn an_event_ends_the_run() {
    let function = EventFunction::Function(Arc::new(|t, x| Some(x[0] - t)));
    let mut observer = RunObserver { events: vec![Event { function, direction: -1.0, stop_after: 1 }], ..RunObserver::default() };
    let run = thrown(0.0, Method::Dop853, Some(&mut observer));
    assert_eq!((run.status, run.ended), (Status::Event, observer.crossings.t[0]));
    assert_eq!(run.t.last(), Some(&run.ended));
    // After the rebound, x = 1 - 2 (t - 1/2 - pi/20). The event is at x = t, which is the time (2 + pi/10)/3.
    assert!((run.ended - (2.0 + PI / 10.0) / 3.0).abs() < 1e-8, "{}", run.ended);
    let mut unknown = RunObserver {
        events: vec![Event { function: EventFunction::Function(Arc::new(|_, _| None)), direction: 0.0, stop_after: 0 }],
        ..RunObserver::default()
    };
    assert_eq!(thrown(0.0, Method::Dop853, Some(&mut unknown)).status, Status::Diverged);
}
