#include "worker.hpp"

#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <map>
#include <stdexcept>

#include "end_signals.hpp"
#include "mailbox.hpp"

namespace femxdem {
namespace {

std::optional<Message> receive() {
  Message message;
  for (;;) {
    const ssize_t size = recv(kSocketDescriptor, &message, sizeof message, 0);
    if (size == sizeof message) return message;
    if (size < 0 && errno == EINTR) continue;
    return std::nullopt;
  }
}

void reply(const Message& message, ReplyKind kind, std::int64_t value = 0, std::int64_t mail = 0) {
  const Reply reply{kind, message.number, value, mail};
  send(kSocketDescriptor, &reply, sizeof reply, MSG_NOSIGNAL);
}

void reply_error(const Message& message, const std::string& sentence) {
  reply(message, ReplyKind::error, 0, put_mail(kMailDescriptor, sentence));
}

/// From now on this process dies with its parent, which must be `parent`.
void die_with(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
}

void write_sentence(Slot& slot, const char* text) {
  slot.outcome = Outcome::failed;
  std::strncpy(slot.sentence.data(), text, slot.sentence.size() - 1);
  slot.sentence.back() = '\0';
}

}  // namespace

void Worker::serve() {
  while (const auto message = receive()) {
    if (message->command == Command::quit) return;
    try {
      answer(*message);
    } catch (const std::exception& error) {
      reply_error(*message, error.what());
    }
  }
}

void Worker::answer(const Message& message) {
  using Answer = void (Worker::*)(const Message&);
  static const std::map<Command, Answer> answers = {
      {Command::versions, &Worker::versions},
      {Command::make_template, &Worker::make_template},
      {Command::add, &Worker::add},
      {Command::remove, &Worker::remove},
      {Command::evaluate, &Worker::evaluate},
      {Command::commit, &Worker::commit_in_process},
      {Command::report, &Worker::complete_reports},
      {Command::save, &Worker::save},
      {Command::load, &Worker::load},
      {Command::export_scene, &Worker::export_scene},
      {Command::write_back, &Worker::write_back},
      {Command::referee, &Worker::referee},
  };
  if (message.command == Command::reject) return reject_in_process();
  (this->*answers.at(message.command))(message);
}

/// The volume elements are about to be others, or to be in other states.
void Worker::forget_states() {
  snapshot_.clear();
  restored_.clear();
}

void Worker::versions(const Message& message) {
  reply(message, ReplyKind::done, 0, put_mail(kMailDescriptor, engine_.versions()));
}

void Worker::add(const Message& message) {
  forget_states();
  const std::string state = get_mail(kMailDescriptor, message.mail);
  if (ves_.size() + static_cast<std::size_t>(message.a) > Batch::kCapacity)
    throw std::runtime_error("too many volume elements for one rank; use more ranks");
  for (std::int64_t copy = 0; copy < message.a; ++copy) {
    ves_.push_back(engine_.add(state));
    refresh(ves_.size() - 1);
  }
  reply(message, ReplyKind::done);
}

void Worker::remove(const Message& message) {
  forget_states();
  const auto index = static_cast<std::size_t>(message.a);
  engine_.remove(ves_.at(index));
  ves_.erase(ves_.begin() + message.a);
  for (std::size_t i = index; i < ves_.size(); ++i) batch_.slots[i] = batch_.slots[i + 1];
  reply(message, ReplyKind::done);
}

void Worker::export_scene(const Message& message) {
  const Engine::Export made = engine_.export_scene(get_mail(kMailDescriptor, message.mail));
  reply(message, ReplyKind::done, made.covered, put_mail(kMailDescriptor, made.bytes));
}

void Worker::write_back(const Message& message) {
  forget_states();
  const auto index = static_cast<std::size_t>(message.a);
  engine_.write_back(ves_.at(index), get_mail(kMailDescriptor, message.mail));
  refresh(index);
  reply(message, ReplyKind::done);
}

void Worker::referee(const Message& message) {
  forget_states();
  const std::string task = get_mail(kMailDescriptor, message.mail);
  std::array<double, 9> L;
  std::memcpy(L.data(), task.data(), sizeof L);
  const std::string end = engine_.referee(ves_.at(static_cast<std::size_t>(message.a)),
                                          std::string_view(task).substr(sizeof L), L, message.b);
  reply(message, ReplyKind::done, 0, put_mail(kMailDescriptor, end));
}

void Worker::save(const Message& message) {
  const auto index = static_cast<std::size_t>(message.a);
  const std::string state = engine_.save(ves_.at(index));
  restore(index, state);
  reply(message, ReplyKind::done, 0, put_mail(kMailDescriptor, state));
}

void Worker::load(const Message& message) {
  const auto index = static_cast<std::size_t>(message.a);
  restore(index, get_mail(kMailDescriptor, message.mail));
  reply(message, ReplyKind::done);
}

void Worker::restore(std::size_t index, const std::string& state) {
  snapshot_.clear();
  engine_.replace(ves_.at(index), state);
  restored_.resize(ves_.size());
  restored_[index] = state;
  refresh(index);
}

void Worker::refresh(std::size_t index) {
  Slot& slot = batch_.slots[index];
  engine_.measure(ves_[index], slot);
  slot.info = engine_.info(ves_[index]);
}

void Worker::make_template(const Message& message) {
  const std::string specification = get_mail(kMailDescriptor, message.mail);
  engine_.flush();
  const pid_t self = getpid();
  const pid_t child = Engine::fork();
  if (child < 0) throw std::runtime_error("a process for the template could not be started: not enough memory");
  if (child > 0) return await_child(message, child);

  die_with(self);
  setpgid(0, 0);  // what a user's script starts ends with it
  batch_.child = getpid();
  try {
    const Engine::Template made = engine_.make_template(specification);
    engine_.flush();
    const std::int64_t size = put_mail(kMailDescriptor, made.state + made.manifest);
    reply(message, ReplyKind::done, static_cast<std::int64_t>(made.state.size()), size);
  } catch (const std::exception& error) {
    reply_error(message, error.what());
  }
  _exit(kOrderlyExit);
}

void Worker::evaluate(const Message& message) {
  if (message.b == 1) {
    engine_.flush();
    const pid_t self = getpid();
    const pid_t trial = Engine::fork();
    if (trial == 0) return serve_trial(message, self);
    if (trial > 0) return await_child(message, trial);
  }
  if (snapshot_.empty()) take_snapshot();
  if (trial_in_process_) reject_in_process();
  trial_in_process_ = true;
  deform_all(message.a);
  reply(message, ReplyKind::done, 0);
}

void Worker::await_child(const Message& message, pid_t child) {
  siginfo_t ended{};
  while (waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOWAIT) != 0 && errno == EINTR) {
  }
  kill(-child, SIGKILL);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  batch_.child = 0;
  if (WIFEXITED(status) && WEXITSTATUS(status) == kOrderlyExit) return;
  reply(message, ReplyKind::child_died, status);
}

void Worker::serve_trial(const Message& message, pid_t committed) {
  die_with(committed);
  batch_.child = getpid();
  deform_all(message.a);
  reply(message, ReplyKind::done, 1);
  const auto verdict = receive();
  if (!verdict || verdict->command != Command::commit) _exit(kOrderlyExit);
  adopt_trial(*verdict, committed);
}

void Worker::adopt_trial(const Message& message, pid_t committed) {
  follow_networks();
  prctl(PR_SET_PDEATHSIG, 0);
  kill(committed, SIGKILL);  // from here on this is the committed state
  batch_.child = 0;
  forget_states();
  reply(message, ReplyKind::done, getpid());
  while (getppid() == committed) usleep(100);  // until its memory is freed; then the rank is the parent
  die_with(rank_);
}

void Worker::commit_in_process(const Message& message) {
  if (!trial_in_process_) throw std::runtime_error("there is no trial to commit");
  trial_in_process_ = false;
  forget_states();
  follow_networks();
  reply(message, ReplyKind::done, getpid());
}

void Worker::reject_in_process() {
  if (!trial_in_process_) return;
  trial_in_process_ = false;
  for (std::size_t i = 0; i < ves_.size(); ++i) engine_.replace(ves_[i], snapshot_[i]);
}

/// A second restoration of the same state could sum forces in another order: what has just been restored stays.
void Worker::take_snapshot() {
  restored_.resize(ves_.size());
  for (std::size_t i = 0; i < ves_.size(); ++i) {
    if (restored_[i].empty()) {
      restored_[i] = engine_.save(ves_[i]);
      engine_.replace(ves_[i], restored_[i]);
    }
  }
  snapshot_ = std::move(restored_);
  restored_.clear();
}

void Worker::complete_reports(const Message& message) {
  for (std::size_t i = 0; i < ves_.size(); ++i) engine_.complete_report(ves_[i], batch_.slots[i]);
  reply(message, ReplyKind::done);
}

void Worker::follow_networks() noexcept {
  for (std::size_t i = 0; i < ves_.size(); ++i) {
    Slot& slot = batch_.slots[i];
    if (slot.task != Task::follow_network) continue;
    engine_.follow_network(ves_[i]);
    slot.info.time_step = engine_.info(ves_[i]).time_step;
  }
}

void Worker::deform_all(std::int64_t stiffness) {
  for (std::size_t i = 0; i < ves_.size(); ++i) {
    batch_.slots[i].outcome = Outcome::none;
    if (batch_.slots[i].task != Task::deform) continue;
    batch_.in_flight = static_cast<std::int64_t>(i);
    deform_one(i, stiffness);
  }
  batch_.in_flight = kNone;
}

void Worker::deform_one(std::size_t index, std::int64_t stiffness) {
  Slot& slot = batch_.slots[index];
  const int ve = ves_[index];
  const auto start = std::chrono::steady_clock::now();
  try {
    if (slot.steps > 0) engine_.deform(ve, slot);
    engine_.measure(ve, slot);
    if (slot.steps == 0) slot.mean_stress = slot.stress;
    if (stiffness != kNoStiffness) engine_.stiffness(ve, slot, static_cast<VeStiffness>(stiffness));
    slot.outcome = Outcome::answered;
  } catch (const std::exception& error) {
    write_sentence(slot, error.what());
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  slot.report[report_index("seconds")] = seconds.count();
}

}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  if (argc != 4) return 2;
  const auto rank = static_cast<pid_t>(std::stol(argv[3]));
  die_with(rank);
  Message ready;
  try {
    Batch& batch = *static_cast<Batch*>(map_shared(kBatchDescriptor, sizeof(Batch)));
    Engine engine(argv[1], argv[2]);
    for (const int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGILL}) std::signal(signal, SIG_DFL);
    ignore_end_signals();  // importing YADE has handled some
    reply(ready, ReplyKind::done, getpid());
    Worker(engine, batch, rank).serve();
    engine.flush();
  } catch (const std::exception& error) {
    reply_error(ready, error.what());
  }
  _exit(0);  // the volume elements go with the process
}
