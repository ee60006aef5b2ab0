// The same chain, fan-out and diamonds in Coin3D. Prints a line per figure: case, who, nanoseconds, separated by tabs.
// Fan-outs are quadratic and diamonds exponential here, so sizes stay small; no figure is extrapolated.

#include <Inventor/SoDB.h>
#include <Inventor/engines/SoCalculator.h>
#include <Inventor/fields/SoSFFloat.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

template <typename Run> double fastest(double seconds, Run run) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  double best = INFINITY;
  for (int round = 0; round < 3 || std::chrono::duration<double>(Clock::now() - start).count() < seconds; round++) {
    const auto before = Clock::now();
    run(round);
    best = std::fmin(best, std::chrono::duration<double, std::nano>(Clock::now() - before).count());
  }
  return best;
}

static void check(bool right, const char *what) {
  if (!right) {
    std::fprintf(stderr, "coin: wrong value after %s\n", what);
    std::exit(1);
  }
}

using Fields = std::vector<std::unique_ptr<SoSFFloat>>;

static Fields fields(int count) {
  Fields made;
  for (int at = 0; at < count; at++) {
    made.push_back(std::make_unique<SoSFFloat>());
    made.back()->setValue(0.0f);
  }
  return made;
}

static void chain(int length) {
  Fields made = fields(length + 1);
  for (int at = 0; at < length; at++) made[at + 1]->connectFrom(made[at].get());
  const double ns = fastest(0.4, [&](int round) {
    made[0]->setValue(round + 0.5f);
    check(made[length]->getValue() == round + 0.5f, "a chain");
  });
  std::printf("chain of %d, per hop\tCoin3D\t%.3f\n", length, ns / length);
  // Later fields hang on earlier ones, so the end goes first.
  while (!made.empty()) made.pop_back();
}

static void fan_out(int targets) {
  Fields made = fields(targets + 1);
  for (int at = 1; at <= targets; at++) made[at]->connectFrom(made[0].get());
  const double ns = fastest(0.4, [&](int round) {
    made[0]->setValue(round + 0.5f);
    for (int at = 1; at <= targets; at++) check(made[at]->getValue() == round + 0.5f, "a fan-out");
  });
  std::printf("fan-out to %d, per target\tCoin3D\t%.3f\n", targets, ns / targets);
  std::fflush(stdout);
  while (!made.empty()) made.pop_back();
}

static void diamonds(int stages) {
  std::vector<SoCalculator *> engines;
  const auto engine = [&](const char *expression) {
    SoCalculator *made = new SoCalculator;
    made->ref();
    made->expression.setValue(expression);
    engines.push_back(made);
    return made;
  };
  SoCalculator *joint = engine("oa = a");
  SoCalculator *first = joint;
  for (int stage = 0; stage < stages; stage++) {
    SoCalculator *next = engine("oa = a + b");
    SoCalculator *left = engine("oa = a"), *right = engine("oa = a");
    left->a.connectFrom(&joint->oa);
    right->a.connectFrom(&joint->oa);
    next->a.connectFrom(&left->oa);
    next->b.connectFrom(&right->oa);
    joint = next;
  }
  SoSFFloat end;
  end.connectFrom(&joint->oa);
  const double ns = fastest(0.2, [&](int round) {
    first->a.setValue(round + 0.5f);
    check(end.getValue() == std::ldexp(round + 0.5f, stages), "diamonds");
  });
  std::printf("%d diamonds, per node\tCoin3D\t%.3f\n", stages, ns / (3 * stages + 1));
  std::fflush(stdout);
  end.disconnect();
}

int main() {
  SoDB::init();
  chain(1000);
  for (int targets : {1000, 10000}) fan_out(targets);
  for (int stages : {4, 8, 12}) diamonds(stages);
  return 0;
}
