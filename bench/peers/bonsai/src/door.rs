//! The robot that enters a room by one of two doors and watches its battery (section 6 of
//! the paper), with the nodes of bonsai-bt.

use bonsai_bt::{
    Action, ActionArgs, Behavior, Event, Race, Running, Select, Sequence, Status, WhileAll, BT,
};
use std::hint::black_box;
use Door::*;
use Leaf::*;

#[derive(Clone, Copy)]
pub enum Door {
    Front,
    Back,
}

#[derive(Clone, Copy)]
pub enum Leaf {
    TaskUndone,
    BatteryFell,
    BatteryHigh,
    Recharge,
    IsOpen(Door),
    Open(Door),
    Smash(Door),
    PassThrough(Door),
    Close(Door),
    DoTask,
}

/// What the robot's leaves read: its blackboard.
pub struct World {
    battery: f64,
    doorways: [Doorway; 2],
    /// The status of the task.
    task: Status,
}

struct Doorway {
    open: bool,
    /// The status of what the robot does there.
    progress: Status,
}

pub type Agent = BT<Leaf, World>;

/// A robot that has just begun to open the front door, which never ends.
pub fn agent() -> Agent {
    let doorway = || Doorway {
        open: false,
        progress: Running,
    };
    let world = World {
        battery: 50.0,
        doorways: [doorway(), doorway()],
        task: Running,
    };
    BT::new(monitored(), world)
}

/// Of its 21 nodes a tick visits eight.
///
/// When the battery wins the `Race`, the mission begins again later, as with the paper's monitor;
/// with `Select` and `Sequence` without memory it would begin again at every tick.
fn monitored() -> Behavior<Leaf> {
    WhileAll(
        Box::new(Action(TaskUndone)),
        vec![
            Race(vec![Action(BatteryFell), mission()]),
            Select(vec![Action(BatteryHigh), Action(Recharge)]),
        ],
    )
}

fn mission() -> Behavior<Leaf> {
    Sequence(vec![
        Select(vec![
            Sequence(vec![
                Select(vec![Action(IsOpen(Front)), Action(Open(Front))]),
                Action(PassThrough(Front)),
                Action(Close(Front)),
            ]),
            Sequence(vec![
                Select(vec![Action(Open(Back)), Action(Smash(Back))]),
                Action(PassThrough(Back)),
            ]),
        ]),
        Action(DoTask),
    ])
}

pub fn tick(agent: &mut Agent, event: &Event) {
    let outcome = black_box(agent).tick(black_box(event), &mut act);
    assert!(matches!(outcome, Some((Running, _))));
}

fn act(args: ActionArgs<Event, Leaf>, world: &mut World) -> (Status, f64) {
    let until = |ended| if ended { Status::Success } else { Running };
    let holds = |truth| {
        if truth {
            Status::Success
        } else {
            Status::Failure
        }
    };
    let low = world.battery < 10.0;
    let status = match *args.action {
        TaskUndone => until(world.task == Status::Success),
        BatteryFell => until(low),
        BatteryHigh => holds(!low),
        Recharge => {
            world.battery += args.dt;
            until(world.battery >= 100.0)
        }
        IsOpen(door) => holds(world.doorways[door as usize].open),
        Open(door) | Smash(door) | PassThrough(door) | Close(door) => {
            world.doorways[door as usize].progress
        }
        DoTask => world.task,
    };
    (status, args.dt)
}
