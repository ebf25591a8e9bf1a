#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "hdf5_file.hpp"
#include "mesh.hpp"
#include "output_folder.hpp"
#include "point_fields.hpp"

namespace femxdem {

/// Fields of one output step.
struct FieldStep {
  int step = 0;
  double time = 0;                  ///< [s]
  double load_factor = 0;           ///< [-]
  std::vector<Field> node_fields;   ///< displacement, ...: two components become three, for ParaView's vectors
  std::vector<Field> point_fields;  ///< elements x points of an element, in this order
};

/// Fields over the mesh at output steps: results.h5, and results.xdmf that opens it in ParaView.
///
///     /mesh/nodes (nodes, 2) [m], /mesh/elements (elements, 8), /mesh/points (elements, points, 2) [m]
///     /steps/000010            attributes step, time, load_factor
///     /steps/000010/nodes/...  (nodes, components)
///     /steps/000010/points/... (elements, points, components)
///     /steps/000010/cells/...  (elements, components): means over an element's points, what ParaView shows
///
/// Both files are complete and closed after every write: a run that ends early keeps everything written before.
class Results {
 public:
  /// The folder exists (prepare_output_folder). `points`: reference positions of the Gauss points [m], element by
  /// element. With Existing::resume the steps after `last_step` are removed from the files; otherwise they are begun.
  Results(const std::filesystem::path& folder, const Mesh& mesh, std::span<const Point2> points, Existing existing,
          int last_step = 0);

  /// A step that is already there is replaced.
  void write(const FieldStep& step);

 private:
  void create(const Mesh& mesh, std::span<const Point2> points);
  void resume(int last_step);
  void write_xdmf() const;

  std::filesystem::path folder_;
  std::size_t nodes_;
  std::size_t elements_;
  std::map<int, std::string> grids_;  ///< XDMF text of each step written
};

}  // namespace femxdem
