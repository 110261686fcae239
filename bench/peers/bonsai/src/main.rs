//! What bonsai-bt costs at the work of our own benchmarks.
//!
//! `bonsai ROW [N]` measures one row for one round. It prints a line for each figure: its
//! name, a tab, its value.

mod door;
mod list;
mod measure;

use bonsai_bt::{Event, Failure, Running, Success, UpdateArgs};
use std::{env, process::exit, time::Instant};

/// The number of actions of a sequence or a fallback.
const LENGTH: usize = 100_000;

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["tick"] => tick(),
        ["sequence"] => sequence(),
        ["fallback"] => fallback(),
        ["rules", n] => rules(size(n)),
        ["fleet", n] => fleet(size(n)),
        _ => usage(),
    }
}

fn size(word: &str) -> usize {
    let positive = word.parse().ok().filter(|&n| n > 0);
    positive.unwrap_or_else(|| usage())
}

fn usage() -> ! {
    eprintln!("Usage: bonsai tick | sequence | fallback | rules N | fleet N");
    exit(2)
}

fn report(name: &str, value: f64) {
    println!("bonsai {name}\t{value:.4}");
}

/// The event of each tick: a tenth of a second has passed.
fn tenth_of_a_second() -> Event {
    UpdateArgs { dt: 0.1 }.into()
}

/// One tick of the door/battery tree while the robot opens the front door.
fn tick() {
    let (mut agent, event) = (door::agent(), tenth_of_a_second());
    let nanoseconds = measure::nanoseconds(|| door::tick(&mut agent, &event));
    report("door/battery tick", nanoseconds);
}

/// Runs the whole tree, with the reset that a tree needs before it can run again.
fn sequence() {
    let (mut tree, event) = (list::sequence(LENGTH), tenth_of_a_second());
    let nanoseconds = measure::nanoseconds(|| {
        tree.reset_bt();
        list::tick(&mut tree, &event, Success);
    });
    report("sequence step", nanoseconds / LENGTH as f64);
}

/// Runs the whole tree, with its reset, too.
fn fallback() {
    let (mut tree, event) = (list::fallback(LENGTH), tenth_of_a_second());
    let nanoseconds = measure::nanoseconds(|| {
        tree.reset_bt();
        list::tick(&mut tree, &event, Failure);
    });
    report("fallback step", nanoseconds / LENGTH as f64);
}

/// One tick of a priority list of which the last rule holds and runs.
fn rules(n: usize) {
    let (mut tree, event) = (list::rules(n), tenth_of_a_second());
    let nanoseconds = measure::nanoseconds(|| list::tick(&mut tree, &event, Running));
    report(&format!("rules tick {n}"), nanoseconds);
}

/// Many robots, each with its own door/battery tree and world.
fn fleet(n: usize) {
    let each = |value: f64| value / n as f64;
    let (resident, begun) = (measure::resident(), Instant::now());
    let mut agents: Vec<door::Agent> = (0..n).map(|_| door::agent()).collect();
    let creation = begun.elapsed().as_nanos() as f64;
    let bytes = measure::resident() - resident;
    report(&format!("fleet creation {n}"), each(creation));
    report(&format!("fleet bytes {n}"), each(bytes));

    let event = tenth_of_a_second();
    let mut tick_all = || {
        for agent in &mut agents {
            door::tick(agent, &event);
        }
    };
    let nanoseconds = measure::nanoseconds(&mut tick_all);
    report(&format!("fleet tick {n}"), each(nanoseconds));
    let seconds = measure::processor_at_10_hz(&mut tick_all);
    report(&format!("fleet cpu {n}"), seconds);
}
