//! Tests of the URDF reader and writer: examples, round trips, and bad files with the line numbers of their errors.

use crate::arm_common;

use crate::arm_common::{Rng, close};
use armlet_core::arm::{Arm, ChainJoint, EXAMPLES, JointKind, JointType, MAX_BYTES, MAX_DEPTH, STANDARD_GRAVITY, Tree, example_urdf};
use armlet_core::dynamics::{Dynamics, Workspace};
use armlet_core::error::Error;

pub fn read(text: &str) -> Result<Arm, Error> {
    Arm::from_urdf(text, "robot.urdf", STANDARD_GRAVITY, None, None)
}

fn example(name: &str) -> Arm {
    read(example_urdf(name).unwrap()).unwrap()
}

fn names<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    names.collect()
}

/// Return `M(q)`, row-major, and `g(q)`.
pub fn dynamics(arm: &Arm, q: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let tree = Tree::<f64>::new(arm);
    let mut ws = Workspace::new(&tree);
    let (mut m, mut g) = (vec![0.0; q.len() * q.len()], vec![0.0; q.len()]);
    tree.mass_matrix(&mut ws, &arm_common::sin_cos(q), q, &mut m);
    tree.gravity(&mut ws, &arm_common::sin_cos(q), q, &mut g);
    (m, g)
}

#[test]
fn examples_read_as_written() {
    let sizes: Vec<usize> = EXAMPLES.iter().map(|(name, _)| example(name).n()).collect();
    assert_eq!(sizes, [2, 2, 4, 6, 7, 8]);
    let arm = example("two_arms");
    let want = ["lift", "neck", "left_shoulder_pitch", "left_elbow", "left_roll", "right_shoulder_pitch", "right_elbow", "right_roll"];
    assert_eq!(names(arm.joint_names()), want);
    let parents: Vec<Option<usize>> = arm.joints.iter().map(|j| j.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(0), Some(2), Some(3), Some(0), Some(5), Some(6)]);
    assert_eq!(names(arm.frame_names()).len(), 12);
    assert_eq!((arm.joints[4].kind, arm.joints[4].limits.upper, arm.joints[4].limits.effort), (JointKind::Continuous, f64::INFINITY, 15.0));
    assert_eq!((arm.joints[0].damping, arm.joints[0].friction, arm.joints[3].armature), (40.0, 5.0, 0.08));
    let seven = example("seven_axis");
    assert!(seven.report.iter().any(|line| line.contains("fixed to the base") && line.contains("base")), "{:?}", seven.report);
    // The mass of the fixed hand is added to the last body.
    assert!((seven.joints[6].parameters[0] - 1.4).abs() < 1e-15);
    assert!(matches!(example_urdf("nine_axis"), Err(Error::Unknown { available, .. }) if available.contains(&"seven_axis".into())));
}

#[test]
fn two_links_by_hand() {
    // The textbook 2R arm in a vertical plane. Its links are rods with the centre of mass in the middle.
    let arm = example("planar_2r");
    let (m1, m2, l1, c1, c2) = (3.0, 2.0, 0.5, 0.25, 0.2);
    let (i1, i2) = (3.0 * (3.0 * 0.04 * 0.04 + 0.25) / 12.0, 2.0 * (3.0 * 0.03 * 0.03 + 0.16) / 12.0);
    let (q1, q2) = (0.4f64, -0.9f64);
    let (m, g) = dynamics(&arm, &[q1, q2]);
    let m22 = i2 + m2 * c2 * c2;
    let m12 = m22 + m2 * l1 * c2 * q2.cos();
    let m11 = i1 + m1 * c1 * c1 + m22 + m2 * (l1 * l1 + 2.0 * l1 * c2 * q2.cos());
    let g2 = 9.81 * m2 * c2 * (q1 + q2).cos();
    let g1 = 9.81 * (m1 * c1 + m2 * l1) * q1.cos() + g2;
    // The file rounds its inertias to six digits.
    close("M", &m, &[m11, m12, m12, m22], 1e-6, 1.0);
    close("g", &g, &[g1, g2], 1e-12, 1.0);
}

#[test]
fn round_trips() {
    let mut rng = Rng(3);
    let mut arms: Vec<Arm> = EXAMPLES.iter().map(|(name, _)| example(name)).collect();
    arms.push(arms[4].with_payload("tcp", 1.5, [0.02, -0.01, 0.05], [[0.01, 1e-3, 0.0], [1e-3, 0.02, 0.0], [0.0, 0.0, 0.015]]).unwrap());
    arms.push(arms[5].locked(&[("lift", 0.2), ("left_elbow", -1.0)]).unwrap());
    arms.extend((1..12).map(|n| arm_common::random_tree(&mut rng, n).with_gravity(STANDARD_GRAVITY).unwrap()));
    arms.push(Arm::pendulum(0.7, 3.1).unwrap().with_gravity(STANDARD_GRAVITY).unwrap());
    for arm in arms {
        let written = arm.to_urdf();
        let reread = read(&written.text).unwrap();
        assert_eq!(names(reread.joint_names()), names(arm.joint_names()));
        // The example files have a link for every frame. Chains have no base link, and the writer adds one.
        let frame_names: Vec<&str> = reread.frame_names().filter(|name| arm.frame_index(name).is_ok()).collect();
        assert_eq!(frame_names, names(arm.frame_names()), "{}", written.text);
        assert!(reread.frames.len() == arm.frames.len() || written.report.iter().any(|line| line.starts_with("added")));
        // Parameters, placements, axes, limits and drives must be exactly equal.
        assert_eq!(reread.joints, arm.joints);
        for frame in &arm.frames {
            let other = &reread.frames[reread.frame_index(&frame.name).unwrap()];
            assert_eq!((frame.body, frame.placement), (other.body, other.placement), "{}", frame.name);
        }
        assert!(reread == arm || written.report.iter().any(|line| line.starts_with("added")));
        assert_eq!(reread.to_urdf().text, written.text);
        // Other readers ignore the additional attributes. They must obtain the same robot up to a few roundings.
        let plain = read(&without(&written.text, &["rotation", "parameters"])).unwrap();
        for (a, b) in arm.joints.iter().zip(&plain.joints) {
            close(&a.name, &b.parameters, &a.parameters, 1e-14, 1.0);
            for k in 0..3 {
                close(&a.name, b.placement.rotation.column(k).as_slice(), a.placement.rotation.column(k).as_slice(), 1e-15, 1.0);
            }
        }
    }
}

/// Return the text without all attributes of these names.
fn without(text: &str, attributes: &[&str]) -> String {
    attributes.iter().fold(text.to_string(), |text, name| {
        let attribute = format!(" {name}=\"");
        let mut parts = text.split(&attribute);
        let first = parts.next().unwrap_or_default().to_string();
        parts.fold(first, |out, part| out + part.split_once('"').map_or("", |(_, rest)| rest))
    })
}

#[test]
fn a_number_changed_by_hand_counts() {
    let text = arm_common::random_tree(&mut Rng(5), 8).to_urdf().text;
    let arm = read(&text).unwrap();
    assert!(text.contains(" rotation=") && text.contains(" parameters="), "{text}");
    let replaced = |after: usize, key: &str, value: &str| {
        let start = after + text[after..].find(key).unwrap() + key.len();
        let end = start + text[start..].find('"').unwrap();
        format!("{}{value}{}", &text[..start], &text[end..])
    };
    let said = |arm: &Arm, word: &str| arm.report.iter().filter(|line| line.contains(word)).count();
    let inertial = text.find(" parameters=").unwrap();
    let heavy = read(&replaced(inertial, "<mass value=\"", "7.5")).unwrap();
    assert!(heavy.joints.iter().any(|joint| joint.parameters[0] == 7.5));
    assert_eq!(said(&heavy, "parameters of inertial differs from its mass and inertia: ignored"), 1, "{:?}", heavy.report);
    let origin = text[..text.find(" rotation=").unwrap()].rfind("<origin").unwrap();
    let turned = read(&replaced(origin, "rpy=\"", "0.1 0.2 0.3")).unwrap();
    assert_eq!(said(&turned, "rotation of origin differs from its rpy: ignored"), 1, "{:?}", turned.report);
    assert!(heavy != arm && turned != arm && said(&arm, "ignored") == 0);
}

#[test]
fn odd_names_survive() {
    let text = "<robot name='a&amp;b'><link name='x &lt;&quot;&#9;y'/><link name='z'/>\
        <joint name='j&gt;' type='revolute'><parent link='x &lt;&quot;&#9;y'/><child link='z'/></joint></robot>";
    let arm = read(text).unwrap();
    assert_eq!(arm.frames[0].name, "x <\"\ty");
    let back = read(&arm.to_urdf().text).unwrap();
    assert_eq!((back.name, back.frames, back.joints[0].name.as_str()), (arm.name, arm.frames, "j>"));
    // A joint without an axis rotates about x. A joint without limits has infinite limits. The report mentions that its body has no mass.
    assert_eq!((arm.joints[0].axis, arm.joints[0].limits.lower), ([1.0, 0.0, 0.0], f64::NEG_INFINITY));
    assert!(arm.report.iter().any(|line| line.contains("zero mass") && line.contains("j>")));
}

const LINKS: &str = "<robot name='r'>\n<link name='a'/>\n<link name='b'/>\n<link name='c'/>\n";

pub fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!("<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>{inside}</joint>\n")
}

fn inertial(mass: &str, inertia: &str) -> String {
    format!("<robot name='r'>\n<link name='a'>\n<inertial>\n<mass value='{mass}'/>\n<inertia {inertia}/>\n</inertial>\n</link>\n</robot>")
}

#[test]
fn bad_files_are_refused_with_their_line() {
    let chain = joint("j1", "revolute", "a", "b", "") + &joint("j2", "revolute", "b", "c", "");
    let with = |body: &str| format!("{LINKS}{body}</robot>");
    let after = |tail: String| format!("{LINKS}{}{tail}</robot>", joint("j1", "revolute", "a", "b", ""));
    let good = "ixx='1' iyy='1' izz='1'";
    let table: Vec<(String, u32, &str)> = vec![
        ("".into(), 1, "XML"),
        ("not a robot".into(), 1, "XML"),
        ("<robot>\n<link name='a'>\n</robot>".into(), 3, "XML"),
        ("<model name='x'/>".into(), 1, "expected the root element robot"),
        ("<robot name='r'/>".into(), 1, "no links"),
        ("<robot xmlns:xacro='http://www.ros.org/wiki/xacro'>\n<xacro:arg name='x'/></robot>".into(), 2, "xacro robot.xacro"),
        ("<robot>\n<xacro:include filename='x'/></robot>".into(), 2, "xacro robot.xacro"),
        ("<!DOCTYPE robot [<!ENTITY a 'b'>]>\n<robot><link name='a'/></robot>".into(), 1, "XML"),
        (with(""), 3, "3 root links"),
        (with(&joint("j1", "revolute", "a", "b", "")), 4, "2 root links"),
        (with(&(chain.clone() + &joint("j3", "revolute", "c", "a", ""))), 7, "cycle"),
        (with(&(joint("j1", "revolute", "b", "c", "") + &joint("j2", "revolute", "c", "b", ""))), 6, "cycle"),
        (with(&joint("j1", "revolute", "a", "a", "")), 4, "2 root links"),
        (with(&(chain.clone() + &joint("j3", "fixed", "a", "c", ""))), 7, "child of two joints"),
        (with(&(chain.clone() + "<link name='b'/>")), 7, "duplicate: the first is in line 3"),
        (after(joint("j1", "revolute", "b", "c", "")), 6, "joint j1 is a duplicate: the first is in line 5"),
        (after(joint("j2", "floating", "b", "c", "")), 6, "floating"),
        (after(joint("j2", "spherical", "b", "c", "")), 6, "expected revolute, continuous, prismatic or fixed"),
        (after(joint("j2", "revolute", "b", "d", "")), 6, "no link"),
        (after("<joint name='j2' type='revolute'><parent link='b'/></joint>".into()), 6, "no child"),
        (after("<joint type='revolute'><parent link='b'/><child link='c'/></joint>".into()), 6, "no name"),
        (after("<joint name='' type='revolute'><parent link='b'/><child link='c'/></joint>".into()), 6, "no name"),
        (after(joint("j2", "revolute", "b", "c", "<axis xyz='0 0 0'/>")), 6, "axis of joint j2 is zero"),
        (after(joint("j2", "revolute", "b", "c", "<axis xyz='0 nan 1'/>")), 6, "not finite"),
        (after(joint("j2", "revolute", "b", "c", "\n<origin xyz='0 0'/>")), 7, "expected 3 numbers, got 2"),
        (after(joint("j2", "revolute", "b", "c", "<origin rpy='0 0 x'/>")), 6, "not a number"),
        (after(joint("j2", "revolute", "b", "c", "<origin rpy='0 0 1e999'/>")), 6, "not finite"),
        (after(joint("j2", "revolute", "b", "c", "<limit lower='-inf'/>")), 6, "not finite"),
        (after(joint("j2", "revolute", "b", "c", "<limit lower='1'/>\n<limit upper='2'/>")), 7, "second limit"),
        (after(joint("j2", "revolute", "b", "c", "<dynamics damping=''/>")), 6, "expected 1 numbers, got 0"),
        (inertial("-1", good), 4, "negative"),
        (inertial("NaN", good), 4, "not finite"),
        (inertial("1", "ixx='1' iyy='1'"), 5, "no izz"),
        (inertial("1", "ixx='1' iyy='1' izz='-0.1'"), 5, "negative principal moment"),
        (inertial("1", "ixx='1' ixy='2' iyy='1' izz='1'"), 5, "negative principal moment"),
        (inertial("1", "ixx='1' iyy='inf' izz='1'"), 5, "not finite"),
        ("<robot>\n<link name='a'><inertial><mass value='1'/></inertial></link></robot>".into(), 2, "without inertia"),
        ("<robot>\n<link name='a'>\n<inertial/></link></robot>".into(), 3, "without mass"),
        (format!("<robot><link name='a'/>{}{}</robot>", "\n<x>".repeat(MAX_DEPTH), "</x>".repeat(MAX_DEPTH)), 101, "nested too deeply"),
        (format!("<robot>\n<link name='a'{}/></robot>", (0..300).map(|k| format!(" a{k}='0'")).collect::<String>()), 2, "attributes"),
        (
            format!("<robot>\n<link name='a' {}/></robot>", (0..70).map(|k| format!("xmlns:a{k}='{k}' ")).collect::<String>()),
            2,
            "namespaces",
        ),
        (after(joint("j2", "revolute", "b", "c", "\n<origin xyz='0 1e20 0'/>")), 7, "xyz of origin is implausible: expected at most 1e6 m"),
        (after(joint("j2", "fixed", "b", "c", "\n<origin xyz='-1.1e6 0 0'/>")), 7, "xyz of origin is implausible"),
        (
            after(joint("j2", "revolute", "b", "c", "\n\n<origin rpy='0 0 1e7'/>")),
            8,
            "rpy of origin is implausible: expected at most 1e6 rad",
        ),
        (after(joint("j2", "revolute", "b", "c", "\n<axis xyz='0 0 1e-200'/>")), 7, "axis of joint j2 is implausible: expected a vector"),
        (after(joint("j2", "revolute", "b", "c", "\n<axis xyz='1e308 0 1e308'/>")), 7, "axis of joint j2 is implausible"),
        (after(joint("j2", "revolute", "b", "c", "\n<dynamics damping='1e16'/>")), 7, "damping of joint j2 is implausible"),
        (after(joint("j2", "revolute", "b", "c", "\n<dynamics armature='-1e16'/>")), 7, "armature of joint j2 is implausible"),
        (inertial("1.1e9", good), 4, "mass of link a is implausible: expected at most 1e9 kg, got 1.1e9"),
        (inertial("1", "ixx='2e15' iyy='2e15' izz='2e15'"), 5, "inertia of link a is implausible: expected at most 1e15 kg m^2"),
    ];
    for (text, line, word) in table {
        match read(&text) {
            Err(Error::Model { file, line: got, problem }) => {
                assert!(problem.contains(word), "{problem}, expected {word}");
                assert_eq!((file.as_str(), got), ("robot.urdf", line), "{problem}\n{text}");
            }
            other => panic!("{text}: {other:?}"),
        }
    }
    let large = format!("<robot>{}</robot>", " ".repeat(MAX_BYTES));
    assert!(matches!(read(&large), Err(Error::Model { problem, .. }) if problem.contains("too large")));
}

#[test]
fn the_bounds_themselves_are_plausible() {
    let body = "<link name='b'><inertial><origin xyz='1e6 -1e6 1e6' rpy='1e6 0 -1e6'/><mass value='1e9'/>\
        <inertia ixx='1e15' iyy='1e15' izz='1e15'/></inertial></link>";
    let inside = "<origin xyz='-1e6 0 0'/><axis xyz='0 0 1e-6'/><limit lower='-1e30' upper='1e30' effort='1e300' velocity='1e300'/>";
    let arm = read(&format!("<robot><link name='a'/>{body}{}</robot>", joint("j", "revolute", "a", "b", inside))).unwrap();
    assert_eq!(arm.joints[0].axis, [0.0, 0.0, 1.0]);
    assert!(arm.joints[0].parameters.iter().all(|x| x.is_finite()));
    // The sum of offsets may exceed the limits. The writer reports that a reader would refuse such an origin.
    let origin = "<origin xyz='1e6 0 0'/>";
    let long = format!("{LINKS}{}{}</robot>", joint("j1", "fixed", "a", "b", origin), joint("j2", "fixed", "b", "c", origin));
    let written = read(&long).unwrap().to_urdf();
    assert_eq!(written.report, ["joint j2 is implausibly far away: armlet refuses its origin"]);
    assert!(read(&written.text).is_err());
}

#[test]
fn a_late_declaration_is_forgiven() {
    let declaration = "<?xml version=\"1.0\"\n encoding='utf-8'?>";
    let rest = example_urdf("planar_2r").unwrap().split_once("?>").unwrap().1;
    let plain = read(&format!("{declaration}{rest}")).unwrap();
    for before in ["\n", " \t\r\n", "<!-- a comment -->\n", "\n<!-- one -->\n<!-- <?xml ?> two -->", "\u{feff}\n", "\u{feff}"] {
        assert_eq!(read(&format!("{before}{declaration}{rest}")).unwrap(), plain, "{before:?}");
        // The line numbers of errors must not change.
        let error = read(&format!("{before}{declaration}\n<robot>\n<link/></robot>")).unwrap_err();
        let lines = before.matches('\n').count() as u32;
        assert!(matches!(&error, Error::Model { line, .. } if *line == lines + 4), "{error:?}");
    }
    // Only one declaration is accepted, and only before all elements.
    for text in
        [format!("\n{declaration}{declaration}{rest}"), format!("\n<robot/>{declaration}"), "\n<?xml".into(), "<!-- <?xml ?>".into()]
    {
        assert!(matches!(read(&text), Err(Error::Model { problem, .. }) if problem.contains("XML")), "{text}");
    }
}

#[test]
fn names_hold_no_control_characters() {
    let refused = |error: Error, argument: &str| match error {
        Error::Input { argument: got, problem, .. } => {
            assert_eq!((got.as_str(), problem.contains("control character")), (argument, true), "{problem}");
        }
        other => panic!("{other:?}"),
    };
    for bad in ["a\0b", "\u{1b}[31m", "\u{1}", "\u{ffff}"] {
        refused(example("planar_2r").with_frame(bad, "base", [0.0; 3], [0.0; 3]).unwrap_err(), "name");
        let mut joint = ChainJoint::new(JointType::Moving(JointKind::Revolute), [0.0, 0.0, 1.0], [0.0; 3], [0.0; 3], [0.0; 10]);
        joint.name = Some(bad.into());
        refused(Arm::from_chain(&[joint], STANDARD_GRAVITY).unwrap_err(), "joints[0].name");
        for text in [
            format!("<robot><link name='{bad}'/></robot>"),
            format!("<robot><link name='a&#{};'/></robot>", bad.chars().last().map_or(0, |c| c as u32 % 2)),
        ] {
            assert!(matches!(read(&text), Err(Error::Model { .. })), "{text:?}");
        }
    }
    assert!(example("planar_2r").with_frame("tab\t, line\n, \u{e9}", "base", [0.0; 3], [0.0; 3]).is_ok());
}

#[test]
fn what_is_odd_but_usable_is_reported() {
    let body = "<link name='b'><visual><geometry><mesh filename='package://nowhere/b.stl'/></geometry></visual><inertial>\
        <mass value='1'/><inertia ixx='1' iyy='1' izz='3'/></inertial></link><link name='c'><inertial><mass value='0'/>\
        <inertia ixx='0' iyy='0' izz='0'/></inertial></link><gazebo/><gazebo/>";
    let text = format!(
        "<robot><link name='a'/>{body}\n{}\n{}</robot>",
        joint("j1", "revolute", "a", "b", "<dynamics damping='-1'/><limit lower='2' upper='1'/>"),
        joint("j2", "prismatic", "b", "c", "<mimic joint='j1' multiplier='2'/>")
    );
    let arm = read(&text).unwrap();
    assert_eq!((arm.n(), arm.joints.len()), (1, 2));
    for word in [
        "triangle",
        "zero mass: the bodies moved by j2",
        "link c has zero mass",
        "joined with their leaders: j2 = 2 j1 + 0",
        "negative damping",
        "lower limit 2",
        "gazebo of robot (2,",
        "visual of link (1,",
    ] {
        assert_eq!(arm.report.iter().filter(|line| line.contains(word)).count(), 1, "{word}: {:#?}", arm.report);
    }
}

#[test]
fn root_and_tip_cut_the_tree() {
    let text = example_urdf("two_arms").unwrap();
    let cut = |root, tip| Arm::from_urdf(text, "two_arms", STANDARD_GRAVITY, root, tip);
    let left = cut(None, Some("left_hand")).unwrap();
    assert_eq!(names(left.joint_names()), ["lift", "left_shoulder_pitch", "left_elbow", "left_roll"]);
    assert!(left.report.iter().any(|line| line.contains("neck, right_shoulder_pitch")), "{:?}", left.report);
    let arm = cut(Some("column"), Some("left_fore")).unwrap();
    assert_eq!(names(arm.joint_names()), ["left_shoulder_pitch", "left_elbow"]);
    assert_eq!(arm.frames[0].name, "column");
    // Compare with the sub-chain of the complete arm, including the placement relative to the new base.
    let again = example("two_arms").sub_chain(Some("column"), Some("left_fore")).unwrap();
    assert_eq!(names(again.joint_names()), names(arm.joint_names()));
    assert_eq!((again.joints[0].placement, again.parameters()), (arm.joints[0].placement, arm.parameters()));
    // A sub-chain keeps the direction of gravity. The joint of the upper arm is tilted by 0.2 rad about x, and the frame by 0.3 rad.
    let tilted = example("two_arms").with_frame("tilted", "left_upper", [0.3, 0.0, 0.0], [0.0; 3]).unwrap();
    let [x, y, z] = tilted.sub_chain(Some("tilted"), None).unwrap().gravity;
    assert!(x.abs() < 1e-15 && (y + 9.81 * 0.5f64.sin()).abs() < 1e-14 && (z + 9.81 * 0.5f64.cos()).abs() < 1e-14);
    assert!(matches!(cut(None, Some("nose")), Err(Error::Unknown { argument, .. }) if argument == "tip"));
    assert!(matches!(cut(Some("left_upper"), Some("right_upper")), Err(Error::Input { argument, .. }) if argument == "tip"));
    assert!(matches!(example("two_arms").sub_chain(Some("left_upper"), Some("head")), Err(Error::Input { .. })));
}
