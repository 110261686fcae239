// How long BehaviorTree.CPP takes from the change of a condition to the first step of the
// recovery: the row "reaction" of our own benchmarks.
//
// `btcpp GAP` measures one round: the condition changes every 0.3 ms (hot), every 2 ms (cold) or
// every 5 ms (colder). It prints a line for each figure: its name, a tab, its value in
// microseconds.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <semaphore.h>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include "behaviortree_cpp/bt_factory.h"

namespace {

using Clock = std::chrono::steady_clock;

// What the reaction uses.
std::atomic_bool flag{false}; // The condition.
std::atomic_bool over{false};
sem_t ready;                            // Posted when the next change may be made.
std::atomic<Clock::time_point> reacted; // When the latest reaction took its first step.

// An action without ports that runs, once started, until it is halted.
class Action : public BT::StatefulActionNode {
public:
  using StatefulActionNode::StatefulActionNode;
  static BT::PortsList providedPorts() { return {}; }
  BT::NodeStatus onRunning() override { return BT::NodeStatus::RUNNING; }
  void onHalted() override {}
};

class Task : public Action {
public:
  using Action::Action;
  BT::NodeStatus onStart() override {
    sem_post(&ready);
    return BT::NodeStatus::RUNNING;
  }
};

// Its first step stores the time, and is the last one.
class Recovery : public Action {
public:
  using Action::Action;
  BT::NodeStatus onStart() override {
    reacted = Clock::now();
    flag = false;
    return BT::NodeStatus::SUCCESS;
  }
};

// When the condition changes, the reactive sequence halts the task and fails; then, in the same
// tick, the fallback starts the recovery. (A reactive fallback whose first child is the guarded
// recovery would halt the task only after the recovery's first step.)
constexpr const char *program = R"(
<root BTCPP_format="4" main_tree_to_execute="monitor">
  <BehaviorTree ID="monitor">
    <Fallback>
      <ReactiveSequence>
        <Unchanged/>
        <Task/>
      </ReactiveSequence>
      <Recovery/>
    </Fallback>
  </BehaviorTree>
</root>)";

BT::Tree monitor() {
  BT::BehaviorTreeFactory factory;
  factory.registerSimpleCondition("Unchanged", [](BT::TreeNode &) {
    return flag ? BT::NodeStatus::FAILURE : BT::NodeStatus::SUCCESS;
  });
  factory.registerNodeType<Task>("Task");
  factory.registerNodeType<Recovery>("Recovery");
  return factory.createTreeFromText(program);
}

// Ticks when it is woken, and at once after the recovery. A wakeup between the tree's look at its
// signal and its wait is lost, so the wait has a limit.
void run(BT::Tree &tree) {
  while (!over)
    if (tree.tickOnce() == BT::NodeStatus::RUNNING)
      tree.sleep(std::chrono::seconds(1));
}

// The device: it changes the condition repeatedly, each time after a pause.
std::vector<double> during(BT::Tree &tree, std::chrono::milliseconds period, useconds_t gap) {
  std::vector<double> samples;
  const auto begun = Clock::now();
  while (Clock::now() < begun + period) {
    usleep(gap);
    const auto changed = Clock::now();
    flag = true;
    tree.emitWakeUpSignal();
    sem_wait(&ready);
    const std::chrono::duration<double, std::micro> took = reacted.load() - changed;
    samples.push_back(took.count());
  }
  std::sort(samples.begin(), samples.end());
  return samples;
}

// The value that the given part of the sorted samples does not exceed.
double quantile(double part, const std::vector<double> &sorted) {
  return sorted[std::ceil(part * sorted.size()) - 1];
}

} // namespace

int main(int count, char **arguments) {
  const std::string gap = count == 2 ? arguments[1] : "";
  if (gap != "hot" && gap != "cold" && gap != "colder") {
    std::fputs("Usage: btcpp hot | cold | colder\n", stderr);
    return 2;
  }
  const useconds_t pause = gap == "hot" ? 300 : gap == "cold" ? 2000 : 5000;

  sem_init(&ready, 0, 0);
  BT::Tree tree = monitor();
  std::thread runner(run, std::ref(tree));
  sem_wait(&ready);
  during(tree, std::chrono::milliseconds(200), pause);
  const std::vector<double> sorted = during(tree, std::chrono::seconds(3), pause);
  over = true;
  tree.emitWakeUpSignal();
  runner.join();

  const std::pair<const char *, double> shares[] = {{"p50", 0.5}, {"p99", 0.99}};
  for (const auto &[name, part] : shares)
    std::printf("btcpp reaction %s %s\t%.4f\n", gap.c_str(), name, quantile(part, sorted));
}
