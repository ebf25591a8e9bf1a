#include <gtest/gtest.h>

#include "../material_points_contract.hpp"
#include "compact_volume_elements.hpp"
#include "engine_choice.hpp"
#include "errors.hpp"
#include "python_volume_elements.hpp"

namespace femxdem {
namespace {

using contract::expect_same_bits;
using contract::gradients;
using contract::part;

constexpr const char* kSpecification = R"({"source": "prepare", "spheres": 64, "seed": 3, "size_ratio": 1.5,
  "kappa": 500.0, "stiffness_ratio": 1.0, "friction": 0.5, "compaction_friction": 0.0, "cohesion": 0.0,
  "contact_law": "adhesive", "new_contacts": "frictional", "confining_stress": 1e5, "mean_diameter": 1e-3,
  "density": 2600.0, "damping": 0.2, "time_step_safety": 0.8})";

/// Packing of 64 spheres, prepared once for all tests.
const std::string& packing() {
  static const std::string state = [] {
    WorkerProcess worker({});
    return PythonVolumeElements(worker, {}).make_template(kSpecification).state;
  }();
  return state;
}

struct Cells {
  explicit Cells(std::size_t count, VolumeElementOptions options = {})
      : worker({}), points(worker, std::move(options)) {
    points.add(packing(), count);
  }
  WorkerProcess worker;
  PythonVolumeElements points;
};

/// Noise of a granular cell: a path in two trials passes one step more or less than the same path in one. The rate is
/// the same only where min_steps does not bind.
contract::Tolerances tolerances() { return {.strain = 2e-4, .path = 2e-3, .rotation = 1e-10}; }

TEST(YadeVolumeElements, ContractWithFork) {
  VolumeElementOptions options;
  options.min_steps = 1;
  Cells cells(3, options);
  contract::check(cells.points, tolerances());
}

TEST(YadeVolumeElements, ContractWithSerialising) {
  VolumeElementOptions options;
  options.serialise = true;
  options.min_steps = 1;
  Cells cells(3, options);
  contract::check(cells.points, tolerances());
}

/// To the bit where the committed state was itself just restored, to 1e-10 on a path of commits.
TEST(YadeVolumeElements, ForkAgainstSerialising) {
  VolumeElementOptions options;
  options.serialise = true;
  Cells forked(3), saved(3, options);
  const auto F = gradients(3, 1e-3);
  for (const double fraction : {0.25, 0.5, 0.75, 1.0}) {
    const auto a = contract::trial(forked.points, part(F, fraction));
    const auto b = contract::trial(saved.points, part(F, fraction));
    if (fraction == 0.25) expect_same_bits(a, b);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_LE((a[i].stress - b[i].stress).norm(), 1e-10 * a[i].stress.norm());
    forked.points.commit();
    saved.points.commit();
  }
  saved.points.load(forked.points.save());
  expect_same_bits(contract::trial(forked.points, part(F, 1.1)), contract::trial(saved.points, part(F, 1.1)));
}

/// A volume element answers the same in whatever company it lives: what makes results independent of the ranks.
TEST(YadeVolumeElements, CompanyDoesNotMatter) {
  Cells three(3), one(1);
  const auto F = gradients(3, 5e-4);
  for (const double fraction : {0.5, 1.0}) {
    const auto a = contract::trial(three.points, part(F, fraction));
    const auto b = contract::trial(one.points, {part(F, fraction)[0]});
    EXPECT_TRUE(contract::same_bits(a[0].stress, b[0].stress));
    three.points.commit();
    one.points.commit();
  }
}

struct CompactCells {
  explicit CompactCells(std::size_t count, CompactOptions compact = {}, VolumeElementOptions options = {})
      : worker({}), points(worker, std::move(options), std::move(compact)) {
    points.add(packing(), count);
  }
  WorkerProcess worker;
  CompactVolumeElements points;
};

TEST(CompactVolumeElements, Contract) {
  VolumeElementOptions options;
  options.min_steps = 1;
  CompactCells cells(3, {.threads = 2, .check_share = 0, .evidence = {}}, options);
  contract::check_local(cells.points, tolerances());
}

TEST(CompactVolumeElements, EveryTrialOfAPathEqualsYadesToTheBit) {
  CompactCells cells(3, {.threads = 1, .check_share = 1, .evidence = {}});
  const auto F = gradients(3, 1e-3);
  for (const double fraction : {0.3, 0.6, 1.0, 0.5}) {
    contract::trial(cells.points, part(F, fraction));
    cells.points.commit();
  }
  EXPECT_EQ(cells.points.engine_check().trials, 12);
  EXPECT_EQ(cells.points.engine_check().equal, 12);
}

TEST(CompactVolumeElements, ThreadsAndSharingChangeNoBit) {
  CompactCells one(4, {.threads = 1, .check_share = 0, .evidence = {}});
  CompactCells two(4, {.threads = 2, .check_share = 0, .evidence = {}});
  auto F = gradients(4, 1e-3);
  F[1] = F[0];  // an equal history, until they part
  for (const double fraction : {0.4, 0.8}) {
    const auto a = contract::trial(one.points, part(F, fraction));
    expect_same_bits(a, contract::trial(two.points, part(F, fraction)));
    EXPECT_TRUE(contract::same_bits(a[0].stress, a[1].stress));
    one.points.commit();
    two.points.commit();
  }
  F[1] = part(F, 0.9)[1];
  CompactCells alone(1, {.threads = 1, .check_share = 0, .evidence = {}});
  alone.points.load({one.points.save()[1]});
  const auto parted = contract::trial(one.points, F);
  EXPECT_TRUE(contract::same_bits(parted[1].stress, contract::trial(alone.points, {F[1]})[0].stress));
  EXPECT_FALSE(contract::same_bits(parted[0].stress, parted[1].stress));
}

TEST(CompactVolumeElements, WhatTheLastTrialHasStrainedIsNotStrainedAgain) {
  CompactCells cells(3, {.threads = 2, .check_share = 0, .evidence = {}});
  CompactCells others(3, {.threads = 2, .check_share = 0, .evidence = {}});
  const auto F = gradients(3, 1e-3);
  auto G = F;
  G[1] = part(F, 0.9)[1];
  const auto first = contract::trial(cells.points, F), second = cells.points.evaluate(G, Operator::elastic);
  contract::trial(others.points, F);
  others.points.evaluate(part(F, 0.7), Operator::none);  // nothing of it is asked for again
  expect_same_bits(others.points.evaluate(G, Operator::elastic), second);
  for (const std::size_t kept : {0, 2}) {
    EXPECT_TRUE(contract::same_bits(first[kept].stress, second[kept].stress)) << kept;
    EXPECT_EQ(second[kept].report["dem_steps"], 0) << kept;
  }
  EXPECT_GT(second[1].report["dem_steps"], 0);
  cells.points.commit();
  others.points.commit();
  EXPECT_EQ(cells.points.reports()[0]["dem_steps"], first[0].report["dem_steps"]) << "of the state, however it came";
  const auto further = contract::trial(cells.points, part(F, 1.2));
  expect_same_bits(further, contract::trial(others.points, part(F, 1.2)));
  for (const Response& response : further) EXPECT_GT(response.report["dem_steps"], 0);
}

/// A state of compact cells goes on in YADE, and back.
TEST(CompactVolumeElements, StatesGoFromEngineToEngine) {
  CompactCells compact(1);
  WorkerCommand sorted;
  sorted.sorted_contacts = true;
  WorkerProcess worker(sorted);
  VolumeElementOptions options;
  options.quantised = true;
  PythonVolumeElements yade(worker, options);
  yade.add(packing(), 1);
  const auto F = gradients(1, 1e-3);
  contract::trial(compact.points, part(F, 0.5));
  compact.points.commit();
  yade.load(compact.points.save());
  const auto ours = contract::trial(compact.points, F), yades = contract::trial(yade, F);
  expect_same_bits(ours, yades);
  yade.commit();
  compact.points.commit();
  CompactCells back(1);
  back.points.load(yade.save());
  const auto further = contract::trial(back.points, part(F, 1.2));
  expect_same_bits(further, contract::trial(compact.points, part(F, 1.2)));
  expect_same_bits(further, contract::trial(yade, part(F, 1.2)));
}

/// A checkpoint of another packing than the case's is refused in either engine.
TEST(CompactVolumeElements, AStateOfAnotherOriginIsRefused) {
  CompactCells compact(1);
  Cells yade(1);
  VeState saved = decode(compact.points.save()[0]).value();
  ++saved.origin;
  for (LocalPoints* points : {static_cast<LocalPoints*>(&compact.points), static_cast<LocalPoints*>(&yade.points)}) {
    try {
      points->load({encode(saved)});
      ADD_FAILURE() << "it was taken";
    } catch (const UserError& error) {
      EXPECT_NE(std::string(error.what()).find("another packing than the case's"), std::string::npos) << error.what();
    }
  }
}

TEST(CompactVolumeElements, DamagedStatesAreRefused) {
  CompactCells cells(1);
  const std::string state = cells.points.save()[0];
  for (const std::size_t at : {std::size_t{40}, state.size() / 2, state.size() - 1}) {
    std::string damaged = state;
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    EXPECT_THROW(cells.points.load({damaged}), UserError) << at;
    EXPECT_THROW(cells.points.load({state.substr(0, at)}), UserError) << at;
  }
}

/// The same packing under the paper's law, with dashpots and adhesive new contacts.
const std::string& packing_of_the_paper() {
  static const std::string state = [] {
    std::string specification = kSpecification;
    for (const auto& [old, by] : {std::pair{"\"cohesion\": 0.0", "\"cohesion\": 1.0, \"viscous_damping\": 0.1"},
                                  {"\"adhesive\"", "\"paper\""},
                                  {"\"frictional\"", "\"adhesive\""}})
      specification.replace(specification.find(old), std::string(old).size(), by);
    WorkerProcess worker({});
    return PythonVolumeElements(worker, {}).make_template(specification).state;
  }();
  return state;
}

struct CellsOfThePaper {
  explicit CellsOfThePaper(std::size_t count, int threads = 1, VolumeElementOptions options = switched())
      : worker({}), points(worker, std::move(options), {.threads = threads, .check_share = 1, .evidence = {}}) {
    points.add(packing_of_the_paper(), count);
  }
  static VolumeElementOptions switched() {
    VolumeElementOptions options;
    options.start_at_rest = true;
    options.hold_steps = 7;
    return options;
  }
  WorkerProcess worker;
  CompactVolumeElements points;
};

/// With every trial from rest to rest, a path in two trials is another path: only without the switches.
TEST(PaperLaw, Contract) {
  VolumeElementOptions options;
  options.min_steps = 1;
  CellsOfThePaper cells(3, 2, options);
  contract::Tolerances longer = tolerances();
  longer.strain = 1e-3;  // so many DEM steps that those of two halves are as fast as those of the whole
  contract::check_local(cells.points, longer);
}

TEST(PaperLaw, SwitchesThreadsAndARestartGiveTheSameBitsAndYadeRepeatsNothing) {
  CellsOfThePaper one(3, 1), two(3, 2);
  const auto F = gradients(3, 1e-3);
  for (const double fraction : {0.4, 0.8}) {
    const auto a = contract::trial(one.points, part(F, fraction));
    expect_same_bits(a, contract::trial(two.points, part(F, fraction)));
    EXPECT_GE(a[0].report["dem_steps"], 17) << "the hold counts";
    one.points.commit();
    two.points.commit();
  }
  CellsOfThePaper again(3);
  again.points.load(two.points.save());
  expect_same_bits(contract::trial(one.points, F), contract::trial(again.points, F));
  EXPECT_EQ(one.points.engine_check().trials, 0);
  CellsOfThePaper plain(3, 1, {}), switched(3);
  EXPECT_FALSE(contract::same_bits(contract::trial(plain.points, part(F, 0.4))[0].stress,
                                   contract::trial(switched.points, part(F, 0.4))[0].stress));
}

TEST(PaperLaw, TheChoiceOfTheEngineSaysThatYadeHasItNot) {
  WorkerProcess worker({});
  const auto sentence = [&](const std::vector<std::string>& states) {
    const EngineVerdict verdict = choose_engine(EngineChoice::automatic, worker, states);
    EXPECT_EQ(verdict.engine, EngineKind::compact);
    return verdict.sentence;
  };
  const std::string alone = sentence({packing_of_the_paper()}), both = sentence({packing(), packing_of_the_paper()});
  EXPECT_NE(alone.find("1 of 1 templates have ve.contact_law = \"paper\", which YADE has not"), std::string::npos)
      << alone;
  EXPECT_EQ(alone.find("to the bit"), std::string::npos) << alone;
  EXPECT_NE(both.find("every other template equals YADE's to the bit"), std::string::npos) << both;
  EXPECT_NE(both.find("1 of 2 templates"), std::string::npos) << both;
}

}  // namespace
}  // namespace femxdem
