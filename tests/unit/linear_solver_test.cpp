#include "linear_solver.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <new>

namespace femxdem {
namespace {

/// Lets the process have so much more address space [byte].
void allow(rlim_t more) {
  rlim_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlimit limit{pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + more, RLIM_INFINITY};
  setrlimit(RLIMIT_AS, &limit);
}

// OpenBLAS asks for its first buffer for ever: without the check this process is ended by its alarm.
TEST(LinearSolverDeathTest, NoMemoryForBlasIsSaid) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer has taken all address space";
#endif
  testing::FLAGS_gtest_death_test_style = "threadsafe";  // a process in which nothing has been solved yet
  SparseMatrix A(20, 20);
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j) A.insert(i, j) = i == j ? 40.0 : 1.0 + i;
  A.makeCompressed();
  const auto solve = [&] {
    alarm(20);
    allow(rlim_t{64} << 20);
    try {
      LinearSolver().factorise(A, false);
    } catch (const std::bad_alloc&) {
      _exit(7);
    }
    _exit(0);
  };
  EXPECT_EXIT(solve(), testing::ExitedWithCode(7), "");
}

}  // namespace
}  // namespace femxdem
