//! Tests of the URDF reader on unusual files: mutated examples, and chains of many links.

use crate::arm_common::Rng;
use crate::arm_urdf::{dynamics, joint, read};
use armlet_core::arm::EXAMPLES;
use armlet_core::error::Error;
use std::time::{Duration, Instant};

/// Return a robot whose links form a chain of `n` links.
fn chain(kind: &str, n: usize) -> String {
    let mut text = String::from("<robot name='long'>\n<link name='l0'/>\n");
    for k in 1..n {
        text += &format!("<link name='l{k}'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1'/></inertial></link>\n");
        text += &joint(&format!("j{k}"), kind, &format!("l{}", k - 1), &format!("l{k}"), "<origin xyz='0.001 0 0'/>");
    }
    text + "</robot>"
}

/// If each link costs the same, a chain with 6 times as many links takes 6 times as long. If each link searches all others, it takes
/// about 36 times as long. The test compares the shortest times of several trials, so that other work on the machine has little effect.
/// Both arms are larger than the caches of a core. Otherwise one link of the long chain costs up to 3 times as much.
#[test]
fn long_chains_take_time_in_proportion() {
    const SIZES: [usize; 2] = [10_000, 60_000];
    const MOST: f64 = 18.0;
    for kind in ["revolute", "fixed"] {
        let texts = SIZES.map(|n| chain(kind, n));
        let mut least = [f64::INFINITY; 2];
        for trial in 0.. {
            for ((text, n), least) in texts.iter().zip(SIZES).zip(&mut least) {
                let start = Instant::now();
                let arm = read(text).unwrap();
                *least = least.min(start.elapsed().as_secs_f64());
                assert_eq!((arm.n(), arm.frames.len()), (if kind == "fixed" { 0 } else { n - 1 }, n));
                if kind == "fixed" {
                    assert!((arm.frames[n - 1].placement.translation[0] - 0.001 * (n - 1) as f64).abs() < 1e-9);
                }
            }
            if least[1] < MOST * least[0] {
                break;
            }
            assert!(trial < 8, "{kind}: {least:?} s for {SIZES:?} links");
        }
    }
}

/// The longest time in which a mutant must be read.
const LONGEST: Duration = Duration::from_secs(1);

/// Bytes are changed, removed or duplicated, and words are replaced by unusual ones. The reader must return an arm or a `ModelError` within
/// [`LONGEST`].
#[test]
fn mutants_do_no_harm() {
    // With optimisation, as in `make test`, there are 100,000 mutants. ARMLET_URDF_MUTANTS sets another number.
    let usual = if cfg!(debug_assertions) { 5_000 } else { 100_000 };
    let count: usize = std::env::var("ARMLET_URDF_MUTANTS").ok().and_then(|n| n.parse().ok()).unwrap_or(usual);
    const SHARES: usize = 4;
    let shares: Vec<(usize, Duration)> = std::thread::scope(|scope| {
        let shares: Vec<_> = (0..SHARES).map(|share| scope.spawn(move || mutants(7 + share as u64, count.div_ceil(SHARES)))).collect();
        shares.into_iter().map(|share| share.join().unwrap()).collect()
    });
    let read_well: usize = shares.iter().map(|share| share.0).sum();
    let slowest = shares.iter().map(|share| share.1).max().unwrap();
    assert!(slowest < LONGEST, "{slowest:?}");
    // Both outcomes must occur often. Otherwise the mutants test nothing.
    assert!(read_well > count / 20 && read_well < count - count / 20, "{read_well} of {count}");
}

/// Return the number of mutants that were read as arms, and the longest time for one mutant.
fn mutants(seed: u64, count: usize) -> (usize, Duration) {
    const WORDS: [&str; 18] = [
        "nan",
        "-inf",
        "1e308",
        "-1",
        "0",
        "",
        "1e-320",
        "<",
        ">",
        "</link>",
        "<joint>",
        "&lt;",
        "&#0;",
        "]]>",
        "<!--",
        "base",
        "joint1",
        "\u{e9}\u{1F916}",
    ];
    let mut rng = Rng(seed);
    let (mut read_well, mut slowest) = (0, Duration::ZERO);
    for k in 0..count {
        let mut text = EXAMPLES[k % EXAMPLES.len()].1.to_string();
        for _ in 0..1 + rng.below(3) {
            mutate(&mut rng, &mut text, &WORDS);
        }
        let mut least = Duration::MAX;
        // Other work on the machine can delay one trial, but not all of them.
        for trial in 0..4 {
            let start = Instant::now();
            let well = is_read(&text);
            least = least.min(start.elapsed());
            read_well += usize::from(trial == 0 && well);
            if least < LONGEST {
                break;
            }
        }
        slowest = slowest.max(least);
    }
    (read_well, slowest)
}

/// Read a mutant, and return whether it is an arm. The reader must return an arm that is usable, or a `ModelError` with a line of the file.
fn is_read(text: &str) -> bool {
    match read(text) {
        Ok(arm) => {
            let (m, _) = dynamics(&arm, &vec![0.3; arm.n()]);
            assert_eq!(m.len(), arm.n() * arm.n());
            let written = arm.to_urdf();
            let back = read(&written.text);
            assert!(back.is_ok_and(|back| back.n() == arm.n()) || !written.report.is_empty(), "{text}");
            true
        }
        Err(Error::Model { line, .. }) => {
            assert!(line as usize <= text.lines().count() + 1);
            false
        }
        Err(other) => panic!("{other}"),
    }
}

fn mutate(rng: &mut Rng, text: &mut String, words: &[&str]) {
    let edge = |rng: &mut Rng, text: &str| {
        let mut at = rng.below(text.len() + 1);
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    match rng.below(8) {
        // Replace a quoted value.
        0 | 1 => {
            let quotes: Vec<usize> = text.match_indices('"').map(|(at, _)| at).collect();
            if quotes.len() > 1 {
                let k = rng.below(quotes.len() - 1);
                text.replace_range(quotes[k] + 1..quotes[k + 1], words[rng.below(words.len())]);
            }
        }
        2 => text.insert_str(edge(rng, text), words[rng.below(words.len())]),
        3 => {
            let (a, b) = (edge(rng, text), edge(rng, text));
            let (first, mut last) = (a.min(b), a.max(b).min(a.min(b) + 200));
            while !text.is_char_boundary(last) {
                last -= 1;
            }
            text.replace_range(first..last, "");
        }
        4..=6 => {
            // Change one digit. The result is usually another valid robot.
            let digits: Vec<usize> = text.bytes().enumerate().filter(|(_, b)| b.is_ascii_digit()).map(|(at, _)| at).collect();
            if !digits.is_empty() {
                let at = digits[rng.below(digits.len())];
                text.replace_range(at..at + 1, &rng.below(10).to_string());
            }
        }
        _ => {
            // Duplicate a line, which creates duplicate names and second elements.
            let lines: Vec<&str> = text.lines().collect();
            if !lines.is_empty() {
                let k = rng.below(lines.len());
                let doubled = format!("{}\n{}\n{}", lines[..=k].join("\n"), lines[k], lines[k + 1..].join("\n"));
                *text = doubled;
            }
        }
    }
}
