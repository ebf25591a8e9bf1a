// femxdem-verify: closed forms and published values against the finite elements, as JSON.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <functional>
#include <map>

#include "verification.hpp"

namespace femxdem {
namespace {

const std::map<std::string, std::function<Verification()>> kCases = {{"bilinear_bar", verify_bilinear_bar},
                                                                     {"cook", verify_cook},
                                                                     {"cylinder", verify_cylinder},
                                                                     {"jaumann", verify_jaumann},
                                                                     {"multiplier", verify_multiplier},
                                                                     {"patch", verify_patch},
                                                                     {"rice", verify_rice},
                                                                     {"shear_layer", verify_shear_layer},
                                                                     {"single_element", verify_single_element}};

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.15g}", value) : "null"; }

std::string list(const std::vector<double>& values) {
  std::string text;
  for (const double v : values) text += (text.empty() ? "" : ", ") + number(v);
  return "[" + text + "]";
}

template <class T, class Text>
std::string array(const std::vector<T>& items, const Text& text) {
  std::string all;
  for (const T& item : items) all += (all.empty() ? "" : ",\n") + text(item);
  return "[" + all + "]";
}

std::string json(const Row& row) {
  return fmt::format(R"({{"quantity": "{}", "measured": {}, "reference": {}, "tolerance": {}, "order": {}}})",
                     row.quantity, number(row.measured), number(row.reference), number(row.tolerance),
                     number(row.order));
}

std::string json(const Curve& curve) {
  return fmt::format(R"({{"label": "{}", "closed_form": {}, "x": {}, "y": {}}})", curve.label, curve.closed_form,
                     list(curve.x), list(curve.y));
}

std::string json(const Figure& figure) {
  return fmt::format(R"({{"title": "{}", "x_label": "{}", "y_label": "{}", "logarithmic": {}, "curves": {}}})",
                     figure.title, figure.x_label, figure.y_label, figure.logarithmic,
                     array(figure.curves, [](const Curve& c) { return json(c); }));
}

int verify(const std::string& name) {
  const Verification v = kCases.at(name)();
  fmt::print("{{\"rows\": {},\n\"figures\": {}}}\n", array(v.rows, [](const Row& r) { return json(r); }),
             array(v.figures, [](const Figure& f) { return json(f); }));
  return 0;
}

}  // namespace
}  // namespace femxdem

int main(int argc, char** argv) {
  using namespace femxdem;
  if (argc != 2 || (kCases.count(argv[1]) == 0 && std::string(argv[1]) != "--list")) {
    fmt::print(stderr, "usage: femxdem-verify NAME | --list\n");
    return 2;
  }
  try {
    if (std::string(argv[1]) != "--list") return verify(argv[1]);
    for (const auto& entry : kCases) fmt::print("{}\n", entry.first);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "femxdem-verify {}: {}\n", argv[1], error.what());
    return 1;
  }
}
