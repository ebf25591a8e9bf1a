#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "case.hpp"

/// The one table of all parameters: reading, checking, writing and documenting a case follow it.
namespace femxdem {

using Value = std::variant<bool, int, double, std::string, std::vector<int>, std::vector<double>,
                           std::vector<std::string>, std::vector<std::array<double, 2>>>;

/// How a parameter is written in a case file; beyond the type of its value: a word of a list, a path of a file.
enum class Kind { boolean, integer, number, text, integers, numbers, texts, pairs, word, path };

struct Bounds {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool open = false;  ///< the bounds themselves are excluded
  bool contain(double x) const { return open ? min < x && x < max : min <= x && x <= max; }
};

/// A parameter of a section whose values live in the structure S; the default is the value in S{}.
template <class S>
struct Parameter {
  std::string key;
  Kind kind;
  std::string unit;
  std::string text;
  Bounds bounds;                   ///< of a number, or of every number of a list
  std::size_t size = 0;            ///< entries of a list; 0: any
  std::vector<std::string> words;  ///< of Kind::word
  std::function<Value(const S&)> get;
  std::function<void(S&, const Value&)> set;
};

/// A table [name], or one of an array of tables [[name]].
template <class S>
struct Section {
  std::string name;
  std::string text;
  std::vector<Parameter<S>> parameters;
};

struct CaseSections {
  Section<MeshParameters> mesh;
  Section<Region> region;
  Section<ElementParameters> element;
  Section<MaterialParameters> material;
  Section<RegionMaterial> material_region;
  Section<VeParameters> ve;
  Section<RegionVe> ve_region;
  Section<Load> load;
  Section<BodyForce> body_force;
  Section<ControlParameters> control;
  Section<SolverParameters> solver;
  Section<OutputParameters> output;
  Section<Monitor> monitor;
  Section<PathSegment> path;
};
const CaseSections& case_sections();

/// Calls visit(section, member of the case) for every section, a base before its regions; arrays are std::vector.
template <class C, class Visitor>
void for_each_section(C& c, Visitor&& visit) {
  const CaseSections& s = case_sections();
  visit(s.mesh, c.mesh);
  visit(s.region, c.regions);
  visit(s.element, c.element);
  visit(s.material, c.material);
  visit(s.material_region, c.material_regions);
  visit(s.ve, c.ve);
  visit(s.ve_region, c.ve_regions);
  visit(s.load, c.loads);
  visit(s.body_force, c.body_force);
  visit(s.control, c.control);
  visit(s.solver, c.solver);
  visit(s.output, c.output);
  visit(s.monitor, c.monitors);
  visit(s.path, c.path);
}

/// "number", "4 integers", ...
std::string kind_name(Kind kind, std::size_t size);
/// "rectangle | annulus", without empty words.
std::string either(const std::vector<std::string>& words);
/// ">= 0", "> 0 and < 1", or empty.
std::string bounds_text(const Bounds& bounds);
/// Whether a value says anything: not so NaN, an empty text or list, an integer below its bounds.
bool says_something(const Value& value, const Bounds& bounds);
/// The value as TOML (which is JSON too, but for infinities).
std::string toml_text(const Value& value);

}  // namespace femxdem
