#include "ve_service.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <istream>
#include <ostream>
#include <span>
#include <sstream>
#include <string>

#include "errors.hpp"

namespace femxdem {
namespace {

/// Three rows of a tensor; throws UserError where they are not there.
Tensor2 read_gradient(std::istream& words) {
  Tensor2 F;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) words >> F(i, j);
  if (!words) throw UserError("a deformation gradient has 3 x 3 numbers");
  return F;
}

std::string numbers(std::span<const double> values) { return fmt::format(" {:.17g}", fmt::join(values, " ")); }

/// One point between two commits.
class Service {
 public:
  explicit Service(LocalPoints& point) : point_(point) { point_.begin_step(); }
  std::string answer(const std::string& question);

 private:
  std::string evaluate(const Tensor2& F, Operator wanted);
  std::string commit();

  LocalPoints& point_;
  Response last_;
};

std::string Service::answer(const std::string& question) {
  std::istringstream words(question);
  std::string verb;
  words >> verb;
  if (verb == "commit") return commit();
  if (verb == "evaluate") return evaluate(read_gradient(words), Operator::none);
  if (verb == "stiffness") return evaluate(read_gradient(words), Operator::elastic);
  return fmt::format("failed '{}' is no question; evaluate, stiffness or commit", verb);
}

std::string Service::evaluate(const Tensor2& F, Operator wanted) {
  last_ = point_.evaluate(std::array{F}, wanted).front();
  if (last_.failure) return "failed " + describe(*last_.failure);
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const RowMajor stress = last_.stress;
  std::string line = "answer" + numbers({stress.data(), 9}) + numbers(last_.report.values);
  if (wanted == Operator::elastic) line += numbers({last_.stiffness.data(), 81});
  return line;
}

std::string Service::commit() {
  point_.commit();
  complete_reports(point_, {&last_, 1});
  point_.begin_step();
  return "done" + numbers(last_.report.values);
}

}  // namespace

void serve_volume_element(LocalPoints& point, std::istream& questions, std::ostream& answers) {
  answers << fmt::format("= fields {}", fmt::join(kReportFields, " ")) << std::endl;
  Service service(point);
  for (std::string question; std::getline(questions, question);) {
    std::string line;
    try {
      line = service.answer(question);
    } catch (const UserError& error) {
      line = fmt::format("failed {}", error.what());
    } catch (const std::logic_error& error) {
      line = fmt::format("failed {}", error.what());
    }
    answers << "= " << line << std::endl;
  }
}

}  // namespace femxdem
