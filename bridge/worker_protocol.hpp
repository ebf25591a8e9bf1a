#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "material_points.hpp"
#include "ve_parameters.hpp"

/// What a rank and its worker share: commands and replies on a SOCK_SEQPACKET socket, the numbers of the volume
/// elements (VEs) in shared memory, and a mailbox (an anonymous file) for what is long: states, specifications, texts.
namespace femxdem {

/// File descriptors that a worker inherits.
inline constexpr int kSocketDescriptor = 3;
inline constexpr int kBatchDescriptor = 4;
inline constexpr int kMailDescriptor = 5;

/// Status of a forked process of the worker that ended as it was told to.
inline constexpr int kOrderlyExit = 77;

enum class Command : std::uint32_t {
  versions,       ///< mail out: JSON
  make_template,  ///< mail in: JSON; mail out: state (Reply::value bytes), then the manifest as JSON
  add,            ///< mail in: state; a: number of copies, at the end of the batch
  remove,         ///< a: index; those behind move up by one
  evaluate,       ///< a: kNoStiffness or VeStiffness; b: 1 fork, 0 serialise; reply value: 1 if the trial was forked
  commit,         ///< the trial becomes the committed state; reply value: process id of the committed process
  report,         ///< completes the reports of the committed states
  reject,         ///< the trial is given up; no reply
  save,           ///< a: index; mail out: state, from which the volume element goes on
  load,           ///< a: index; mail in: state
  export_scene,   ///< mail in: state; reply value 1 and mail out: what CompactCell::from_scene takes; or 0 and the
                  ///< sentence why compact cells do not cover it
  write_back,     ///< a: index; mail in: what CompactCell::to_scene gave: the volume element becomes it
  referee,        ///< a: index, b: steps; mail in: velocity gradient (9 numbers), then as write_back: strained with the
                  ///< contacts in the order of their spheres; mail out: its export
  quit            ///< no reply
};

/// An evaluation is to find no stiffness; else the number of a VeStiffness.
inline constexpr std::int64_t kNoStiffness = -1;

struct Message {
  Command command = Command::quit;
  std::uint32_t number = 0;  ///< of the message; the reply repeats it
  std::int64_t a = 0;
  std::int64_t b = 0;
  std::int64_t mail = 0;  ///< bytes in the mailbox
};

enum class ReplyKind : std::uint32_t {
  done,
  error,       ///< the mailbox holds the sentence
  child_died,  ///< a forked process (trial or template) ended by itself; value: its wait status
};

struct Reply {
  ReplyKind kind = ReplyKind::done;
  std::uint32_t number = 0;
  std::int64_t value = 0;
  std::int64_t mail = 0;
};

/// What a volume element is asked to do: in a trial, deform or nothing; when it is committed, let its time step follow
/// its contact network or nothing.
enum class Task : std::int64_t { deform, skip, follow_network };

/// What became of it.
enum class Outcome : std::int64_t { none, answered, failed };

/// What the rank needs to choose rate and number of steps; see yade_scripts/protocol.py, info.
struct VeInfo {
  double time_step = 0;    ///< [s]
  double time_scale = 0;   ///< a sqrt(rho / p) [s]
  double mean_stress = 0;  ///< [Pa], compression positive
};

/// One volume element in shared memory. Tensors are row-major.
struct Slot {
  // from the rank
  Task task = Task::deform;
  std::array<double, 9> velocity_gradient{};  ///< [1/s]
  std::int64_t steps = 0;
  std::int64_t sample_every = 0;  ///< DEM steps between the stresses of the mean; 0: no mean
  double late = 0;                ///< how these weigh: 1 + late (2 t / T - 1)
  // from the worker
  Outcome outcome = Outcome::none;
  std::array<double, 9> stress{};                     ///< Cauchy, of the end [Pa], tension positive
  std::array<double, 9> mean_stress{};                ///< over the trial [Pa], when asked for
  std::array<double, kReportFields.size()> report{};  ///< complete once it is committed, added, saved or loaded
  std::array<double, 9> stretch{};                    ///< deformation gradient of the cell from the reference
  std::array<double, 81> stiffness{};                 ///< [Pa], when asked for
  VeInfo info;                                        ///< when it was added, saved or loaded; the time step as it is
  std::array<char, 400> sentence{};                   ///< why it failed, zero-terminated
};

inline constexpr std::int64_t kNone = -1;

/// The shared memory. The file behind it is sparse: pages exist once they are written.
struct Batch {
  static constexpr std::size_t kCapacity = std::size_t{1} << 18;

  std::atomic<std::int64_t> in_flight{kNone};  ///< volume element that the trial is working on
  std::atomic<std::int64_t> child{0};          ///< process id of the forked process, 0: none
  std::array<Slot, kCapacity> slots;
};
static_assert(std::atomic<std::int64_t>::is_always_lock_free);

}  // namespace femxdem
