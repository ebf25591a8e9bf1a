#include "results.hpp"

#include <fmt/format.h>

#include <cassert>

#include "disk_file.hpp"
#include "errors.hpp"

namespace femxdem {
namespace {

constexpr const char* kFile = "results.h5";

std::string group_of(int step) { return fmt::format("/steps/{:06d}", step); }

/// ParaView's vectors have three components.
Field padded(const Field& field) {
  if (field.components != 2) return field;
  Field vectors{field.name, 3, {}};
  for (std::size_t k = 0; k < field.values.size(); k += 2) {
    vectors.values.insert(vectors.values.end(), {field.values[k], field.values[k + 1], 0.0});
  }
  return vectors;
}

std::vector<double> element_means(const Field& field, std::size_t elements) {
  const std::size_t points = field.values.size() / (elements * field.components);
  std::vector<double> means(elements * field.components, 0.0);
  for (std::size_t k = 0; k < field.values.size(); ++k) {
    const std::size_t element = k / (points * field.components);
    means[element * field.components + k % field.components] += field.values[k] / static_cast<double>(points);
  }
  return means;
}

std::string attribute_type(std::size_t components) {
  switch (components) {
    case 1:
      return "Scalar";
    case 3:
      return "Vector";
    case 6:
      return "Tensor6";
    case 9:
      return "Tensor";
    default:
      return "Matrix";
  }
}

std::string data_item(const std::string& path, const Shape& shape, const char* type) {
  return fmt::format("<DataItem Format=\"HDF\" Dimensions=\"{}\" {}>{}:{}</DataItem>", fmt::join(shape, " "), type,
                     kFile, path);
}

std::string attribute(const Hdf5File& h5, const std::string& group, const std::string& name, const char* center) {
  const std::string path = group + "/" + name;
  const Shape shape = h5.shape(path);
  return fmt::format("      <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", name,
                     attribute_type(shape.at(1)), center,
                     data_item(path, shape, "NumberType=\"Float\" Precision=\"8\""));
}

/// One grid of the time series, from what the file holds of a step.
std::string grid(const Hdf5File& h5, const std::string& step) {
  const Shape elements = h5.shape("/mesh/elements");
  std::string text = fmt::format("    <Grid Name=\"{}\" GridType=\"Uniform\">\n      <Time Value=\"{:.17g}\"/>\n", step,
                                 h5.number("/steps/" + step, "time"));
  text += fmt::format("      <Topology TopologyType=\"Quadrilateral_8\" NumberOfElements=\"{}\">{}</Topology>\n",
                      elements.at(0), data_item("/mesh/elements", elements, "NumberType=\"Int\" Precision=\"4\""));
  text += fmt::format("      <Geometry GeometryType=\"XY\">{}</Geometry>\n",
                      data_item("/mesh/nodes", h5.shape("/mesh/nodes"), "NumberType=\"Float\" Precision=\"8\""));
  const std::string group = "/steps/" + step;
  for (const std::string& name : h5.members(group + "/nodes")) text += attribute(h5, group + "/nodes", name, "Node");
  for (const std::string& name : h5.members(group + "/cells")) text += attribute(h5, group + "/cells", name, "Cell");
  return text + "    </Grid>\n";
}

void write_mesh(Hdf5File& h5, const Mesh& mesh, std::span<const Point2> points) {
  std::vector<double> nodes;
  for (const Point2& node : mesh.nodes) nodes.insert(nodes.end(), {node.x(), node.y()});
  std::vector<int> elements;
  for (const auto& element : mesh.elements) elements.insert(elements.end(), element.begin(), element.end());
  std::vector<double> positions;
  for (const Point2& point : points) positions.insert(positions.end(), {point.x(), point.y()});
  h5.write("/mesh/nodes", nodes, {mesh.nodes.size(), 2});
  h5.write("/mesh/elements", elements, {mesh.elements.size(), 8});
  h5.write("/mesh/points", positions, {mesh.elements.size(), points.size() / mesh.elements.size(), 2});
  for (const auto& [name, members] : mesh.regions) h5.write("/mesh/regions/" + name, members, {members.size()});
}

}  // namespace

Results::Results(const std::filesystem::path& folder, const Mesh& mesh, std::span<const Point2> points,
                 Existing existing, int last_step)
    : folder_(folder), nodes_(mesh.nodes.size()), elements_(mesh.elements.size()) {
  assert(points.size() % elements_ == 0);
  if (existing == Existing::resume && std::filesystem::exists(folder / kFile)) {
    resume(last_step);
  } else {
    create(mesh, points);
  }
  write_xdmf();
}

void Results::create(const Mesh& mesh, std::span<const Point2> points) {
  Hdf5File h5(folder_ / kFile, Hdf5File::Mode::create);
  std::uint64_t bytes = 64 * mesh.nodes.size() + 64 * mesh.elements.size() + 16 * points.size();
  for (const auto& [name, members] : mesh.regions) bytes += 4 * members.size();
  h5.reserve(bytes, 8 + mesh.regions.size());
  write_mesh(h5, mesh, points);
  h5.make_group("/steps");
  h5.finish();
}

void Results::resume(int last_step) try {
  Hdf5File h5(folder_ / kFile, Hdf5File::Mode::update);
  for (const std::string& step : h5.members("/steps")) {
    if (std::stoi(step) > last_step) {
      h5.remove("/steps/" + step);
    } else {
      grids_[std::stoi(step)] = grid(h5, step);
    }
  }
  h5.finish();
} catch (const Hdf5Error& error) {
  throw UserError(
      fmt::format("{}; the file is damaged: move it away to go on from the checkpoint without its steps, or restore it",
                  error.what()));
}

void Results::write(const FieldStep& step) {
  try {
    Hdf5File h5(folder_ / kFile, Hdf5File::Mode::update);
    const std::string group = group_of(step.step);
    std::uint64_t bytes = 0;
    for (const Field& field : step.node_fields) bytes += 12 * field.values.size();  // two components become three
    for (const Field& field : step.point_fields) bytes += 16 * field.values.size();
    h5.reserve(bytes, 4 + step.node_fields.size() + 2 * step.point_fields.size());
    if (h5.exists(group)) h5.remove(group);
    h5.make_group(group);
    h5.set_attribute(group, "step", step.step);
    h5.set_attribute(group, "time", step.time);
    h5.set_attribute(group, "load_factor", step.load_factor);
    for (const Field& given : step.node_fields) {
      const Field field = padded(given);
      h5.write(group + "/nodes/" + field.name, field.values, {nodes_, field.components});
    }
    for (const Field& field : step.point_fields) {
      const std::size_t points = field.values.size() / (elements_ * field.components);
      h5.write(group + "/points/" + field.name, field.values, {elements_, points, field.components});
      h5.write(group + "/cells/" + field.name, element_means(field, elements_), {elements_, field.components});
    }
    grids_[step.step] = grid(h5, fmt::format("{:06d}", step.step));
    h5.finish();
  } catch (const Hdf5Error& error) {
    throw DiskError(fmt::format("{}; it {}", error.what(), kTakenAway));
  }
  write_xdmf();
}

void Results::write_xdmf() const {
  std::string text =
      "<?xml version=\"1.0\"?>\n<Xdmf Version=\"2.0\">\n  <Domain>\n"
      "   <Grid Name=\"steps\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (const auto& [step, grid] : grids_) text += grid;
  text += "   </Grid>\n  </Domain>\n</Xdmf>\n";
  replace_file(folder_ / "results.xdmf", text);
}

}  // namespace femxdem
