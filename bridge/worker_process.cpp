#include "worker_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <system_error>

#include "end_signals.hpp"
#include "errors.hpp"
#include "locations.hpp"
#include "mailbox.hpp"

namespace femxdem {
namespace {

using Clock = std::chrono::steady_clock;

/// Environment of the worker: one thread, nothing of our MPI, nothing that moves Python's own folders. CHOLMOD asks
/// OpenMP for four threads whatever OMP_NUM_THREADS says, and a trial, being a fork, waits for ever for those of its
/// parent: the limit leaves none.
std::vector<std::string> worker_environment(bool sorted_contacts) {
  std::vector<std::string> kept;
  for (char** entry = environ; *entry; ++entry) {
    const std::string_view text = *entry;
    bool ours = false;
    for (const std::string_view prefix :
         {"OMPI_", "PMIX_", "PMI_", "OMP_NUM_THREADS=", "OMP_THREAD_LIMIT=", "PYTHONHOME="})
      ours = ours || text.starts_with(prefix);
    if (!ours) kept.emplace_back(text);
  }
  if (std::getenv("FEMXDEM_YADE_DIR") == nullptr) kept.emplace_back("FEMXDEM_YADE_DIR=" FEMXDEM_YADE_DIR);
  if (std::getenv("HOME") == nullptr) kept.emplace_back("HOME=/tmp");  // YADE's modules look for it
  kept.emplace_back("OMP_NUM_THREADS=1");
  kept.emplace_back("OMP_THREAD_LIMIT=1");
  if (sorted_contacts) kept.emplace_back("FEMXDEM_SORTED_CONTACTS=1");
  return kept;
}

std::vector<char*> pointers(std::vector<std::string>& texts) {
  std::vector<char*> list;
  for (std::string& text : texts) list.push_back(text.data());
  list.push_back(nullptr);
  return list;
}

/// Puts the descriptors at the places where the worker looks for them, by way of numbers above them all.
void place_descriptors(std::array<int, 3> descriptors) {
  const std::array<int, 3> places = {kSocketDescriptor, kBatchDescriptor, kMailDescriptor};
  for (int& descriptor : descriptors) descriptor = fcntl(descriptor, F_DUPFD_CLOEXEC, 16);
  for (std::size_t k = 0; k < places.size(); ++k) dup2(descriptors[k], places[k]);
}

std::uint64_t proportional_set_size(std::int64_t pid) {
  std::ifstream file(fmt::format("/proc/{}/smaps_rollup", pid));
  std::string word;
  while (file >> word)
    if (std::uint64_t kilobytes = 0; word == "Pss:" && file >> kilobytes) return kilobytes * 1024;
  return 0;
}

/// Waits at most `seconds` for the process to end; true if it has.
bool wait_for_end(pid_t pid, double seconds) {
  const auto until = Clock::now() + std::chrono::duration<double>(seconds);
  while (waitpid(pid, nullptr, WNOHANG) <= 0 && kill(pid, 0) == 0) {  // < 0: not yet handed over to this process
    if (Clock::now() > until) return false;
    usleep(1000);
  }
  return true;
}

}  // namespace

std::string describe_wait_status(std::int64_t status) {
  const int number = static_cast<int>(status);
  if (WIFSIGNALED(number)) return fmt::format("signal {} ({})", WTERMSIG(number), strsignal(WTERMSIG(number)));
  return fmt::format("exit status {}", WEXITSTATUS(number));
}

WorkerProcess::WorkerProcess(WorkerCommand command) : command_(std::move(command)) {
  if (command_.executable.empty()) command_.executable = locations().worker;
  if (command_.python_path.empty()) command_.python_path = locations().yade_scripts;
  if (access(command_.executable.c_str(), X_OK) != 0)
    throw UserError(fmt::format("worker '{}': no such program; build it (setup.sh build) or name another",
                                command_.executable.string()));
  batch_descriptor_ = memfd_create("femxdem-batch", MFD_CLOEXEC);
  mail_descriptor_ = memfd_create("femxdem-mail", MFD_CLOEXEC);
  if (batch_descriptor_ < 0 || mail_descriptor_ < 0) throw system_error("shared memory of the worker");
  if (ftruncate(batch_descriptor_, sizeof(Batch)) != 0) throw system_error("shared memory of the worker");
  batch_ = static_cast<Batch*>(map_shared(batch_descriptor_, sizeof(Batch)));
  batch_->in_flight = kNone;
  start();
}

void WorkerProcess::start() {
  // Trial processes that become committed lose their parent: they are handed over to this process.
  prctl(PR_SET_CHILD_SUBREAPER, 1);
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw system_error("socket of the worker");
  std::vector<std::string> arguments = {command_.executable.string(), command_.engine,
                                        std::filesystem::absolute(command_.python_path).string(),
                                        std::to_string(getpid())};
  std::vector<std::string> environment = worker_environment(command_.sorted_contacts);
  const std::vector<char*> argv = pointers(arguments), envp = pointers(environment);
  pid_ = fork();
  if (pid_ < 0) throw system_error("worker: cannot be started");
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    ignore_end_signals();
    if (const int nothing = open("/dev/null", O_RDONLY | O_CLOEXEC); nothing >= 0) dup2(nothing, STDIN_FILENO);
    place_descriptors({ends[1], batch_descriptor_, mail_descriptor_});
    execve(argv[0], argv.data(), envp.data());
    _exit(127);
  }
  close(ends[1]);
  socket_ = ends[0];
}

WorkerProcess::~WorkerProcess() {
  end();
  munmap(batch_, sizeof(Batch));
  for (const int descriptor : {socket_, batch_descriptor_, mail_descriptor_}) close(descriptor);
}

void WorkerProcess::end() {
  const Message quit;
  ::send(socket_, &quit, sizeof quit, MSG_NOSIGNAL);  // a trial that waits takes it as a rejection
  ::send(socket_, &quit, sizeof quit, MSG_NOSIGNAL);
  retired_.push_back(pid_);
  for (const pid_t pid : retired_) {
    if (wait_for_end(pid, 5)) continue;
    kill(pid, SIGKILL);
    wait_for_end(pid, 5);
  }
  if (const auto orphan = static_cast<pid_t>(batch_->child); orphan > 0) wait_for_end(orphan, 1);
}

Reply WorkerProcess::request(Command command, std::int64_t a, std::int64_t b, std::string_view mail) {
  wait_until_ready();
  const std::uint32_t number = send(command, a, b, mail);
  const double timeout = command == Command::make_template ? command_.template_timeout
                         : command == Command::evaluate    ? std::min(patience_, command_.point_timeout)
                                                           : command_.point_timeout;
  const Reply reply = receive(number, command, timeout);
  if (reply.kind == ReplyKind::error) throw UserError(this->mail(reply));
  return reply;
}

void WorkerProcess::tell(Command command) {
  wait_until_ready();
  send(command, 0, 0, {});
}

std::string WorkerProcess::mail(const Reply& reply) const { return get_mail(mail_descriptor_, reply.mail); }

std::optional<std::size_t> WorkerProcess::in_flight() const {
  const std::int64_t index = batch_->in_flight;
  return index == kNone ? std::nullopt : std::optional(static_cast<std::size_t>(index));
}

void WorkerProcess::wait_until_ready() {
  if (ready_) return;
  const Reply reply = receive(0, Command::versions, command_.point_timeout);
  if (reply.kind == ReplyKind::error) throw UserError(mail(reply));
  ready_ = true;
}

std::uint32_t WorkerProcess::send(Command command, std::int64_t a, std::int64_t b, std::string_view mail) {
  reap();
  const std::int64_t size = mail.empty() ? 0 : put_mail(mail_descriptor_, mail);
  const Message message{command, ++sent_, a, b, size};
  if (::send(socket_, &message, sizeof message, MSG_NOSIGNAL) != sizeof message)
    throw WorkerLost(lost("it does not take commands any more"));
  return sent_;
}

std::string WorkerProcess::lost(const char* how) const {
  return fmt::format("worker (process {}): {}, its volume elements are lost; restart from the last checkpoint", pid_,
                     how);
}

Reply WorkerProcess::receive(std::uint32_t number, Command command, double timeout) {
  double waited = 0;  // [s] without progress, counted: who is suspended along with the worker has not waited
  std::int64_t seen = batch_->in_flight;
  for (;;) {
    pollfd waiting{socket_, POLLIN, 0};
    if (const int arrived = poll(&waiting, 1, 1000); arrived <= 0) {
      if (arrived == 0) waited += 1;
      if (const std::int64_t now = batch_->in_flight; now != seen) {
        seen = now;
        waited = 0;
      }
      if (waited > timeout) end_what_is_late(waited > 2 * timeout);
      continue;
    }
    Reply reply;
    const ssize_t size = recv(socket_, &reply, sizeof reply, 0);
    if (size < 0 && errno == EINTR) continue;
    if (size != sizeof reply) throw WorkerLost(lost("it ended by itself"));
    if (reply.number == number) return reply;
    // the trial may have taken the commit from the socket and died before it answered: nobody will
    if (command == Command::commit && reply.kind == ReplyKind::child_died)
      throw UserError(fmt::format("the trial ended with {} while it was committed", describe_wait_status(reply.value)));
  }
}

/// The forked process, whose end the committed one reports; the committed one where it works itself or reports nothing.
void WorkerProcess::end_what_is_late(bool reported_nothing) {
  const auto child = static_cast<pid_t>(batch_->child.load());
  kill(child > 0 && !reported_nothing ? child : pid_, SIGKILL);
}

void WorkerProcess::adopt(pid_t pid) {
  if (pid == pid_) return;
  retired_.push_back(pid_);
  pid_ = pid;
}

void WorkerProcess::reap() {
  std::erase_if(retired_, [](pid_t pid) { return waitpid(pid, nullptr, WNOHANG) != 0; });
}

std::uint64_t WorkerProcess::memory() const {
  const std::int64_t child = batch_->child;
  return proportional_set_size(pid_) + (child > 0 ? proportional_set_size(child) : 0);
}

}  // namespace femxdem
