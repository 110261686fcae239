//! Long flat trees: a sequence, a fallback, and a priority list of guarded actions.

use bonsai_bt::{
    Action, ActionArgs, Behavior, Event, Failure, Running, Select, Sequence, Status, Success, BT,
};
use std::hint::black_box;

#[derive(Clone, Copy)]
pub enum Leaf {
    /// Whether the condition with this number holds.
    Holds(usize),
    Act,
}

/// What the leaves read: the blackboard.
pub struct World {
    conditions: Vec<bool>,
    /// How each action ends, if it does.
    outcome: Status,
}

pub type Tree = BT<Leaf, World>;

fn tree(behavior: Behavior<Leaf>, conditions: Vec<bool>, outcome: Status) -> Tree {
    let world = World {
        conditions,
        outcome,
    };
    BT::new(behavior, world)
}

/// A sequence of actions that succeed at once.
pub fn sequence(n: usize) -> Tree {
    tree(Sequence(vec![Action(Leaf::Act); n]), vec![], Success)
}

/// A fallback over actions that fail at once.
pub fn fallback(n: usize) -> Tree {
    tree(Select(vec![Action(Leaf::Act); n]), vec![], Failure)
}

/// The first rule that holds runs. Only the last one holds; its action never ends. Without
/// memory, so that each tick evaluates all of them.
pub fn rules(n: usize) -> Tree {
    let rule = |i| Sequence(vec![Action(Leaf::Holds(i)), Action(Leaf::Act)]);
    let list = Select((0..n).map(rule).collect()).memory(false);
    tree(list, (1..=n).map(|i| i == n).collect(), Running)
}

pub fn tick(tree: &mut Tree, event: &Event, expected: Status) {
    let outcome = black_box(tree).tick(black_box(event), &mut act);
    assert!(matches!(outcome, Some((status, _)) if status == expected));
}

fn act(args: ActionArgs<Event, Leaf>, world: &mut World) -> (Status, f64) {
    let status = match *args.action {
        Leaf::Holds(i) if world.conditions[i] => Success,
        Leaf::Holds(_) => Failure,
        Leaf::Act => world.outcome,
    };
    (status, args.dt)
}
