#!/usr/bin/env bash
# Builds, tests and shows femxdem on Debian 12. Run `bash setup.sh` for what it can do.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
export HOME=${HOME:-/tmp}  # YADE reads it; a container that is being made has none

readonly BUILD=build/release
readonly PYTHON=/usr/bin/python3  # the one that Debian's YADE is built for, whatever comes first on PATH
readonly PACKAGES=(
  build-essential cmake ninja-build pkg-config ccache
  yade python3-dev pybind11-dev python3-numpy python3-scipy python3-matplotlib python3-h5py
  libopenmpi-dev openmpi-bin libeigen3-dev libsuitesparse-dev libhdf5-dev libgmsh-dev gmsh
  libtomlplusplus-dev libcli11-dev libfmt-dev libgtest-dev libbenchmark-dev
)
readonly TEST_PACKAGES=(chromium-headless-shell)  # opens the page of `femxdem report`

usage() {
  cat <<'TEXT'
usage: bash setup.sh build | demo | test [LABEL] | install PREFIX
  build         install what is missing, configure and build to build/release
  demo          build, then a biaxial test on YADE volume elements, 2 ranks: figures in out/demo
  test [LABEL]  build, then all tests, or those of a label: unit, mpi, bridge, yade
  install PREFIX  build the program alone and install it to PREFIX, a folder that may be moved: PREFIX/bin/femxdem
TEXT
}

say() { printf '== %s\n' "$*"; }
fail() {
  printf 'setup.sh: %s\n' "$1" >&2
  exit "${2:-1}"
}

missing_packages() {
  local package
  for package in "${PACKAGES[@]}" "$@"; do
    [[ $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) == installed ]] || echo "$package"
  done
}

install_packages() {
  command -v apt-get >/dev/null || fail "no apt-get here: this needs Debian 12 (bookworm) or a container of it"
  local missing as_root=()
  mapfile -t missing < <(missing_packages "$@")
  if ((${#missing[@]} == 0)); then
    return
  fi
  if ((EUID != 0)); then
    command -v sudo >/dev/null || fail "packages are missing and there is no sudo; as root: apt-get install ${missing[*]}"
    as_root=(sudo)
  fi
  say "installing ${#missing[@]} Debian packages: ${missing[*]}"
  "${as_root[@]}" apt-get update -q
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${missing[@]}"
}

check_python() {
  local modules=/usr/lib/x86_64-linux-gnu/yade-double/py
  [[ -d $modules ]] || fail "$modules is not there: reinstall the package yade"
  (cd / && OMP_NUM_THREADS=1 PYTHONPATH=$modules "$PYTHON" -c 'import yade.wrapper, yade._utils, yade.utils') >/dev/null ||
    fail "$PYTHON cannot import YADE from $modules (text above); it must be Debian's own Python 3.11"
}

build() {
  install_packages
  check_python
  say "building to $BUILD"
  if [[ ! -f $BUILD/build.ninja ]]; then
    cmake --preset release
  fi
  cmake --build --preset release "$@"
}

install_program() {
  [[ -n ${1:-} ]] || fail "install wants a folder, such as /usr/local or ~/femxdem" 2
  build --target femxdem femxdem-worker compact_cell
  cmake --install "$BUILD" --prefix "$1"
  say "installed: $1/bin/femxdem"
}

# Open MPI refuses root and more ranks than cores unless told.
allow_mpi_everywhere() {
  export OMPI_MCA_rmaps_base_oversubscribe=1
  if ((EUID == 0)); then
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
  fi
}

run_tests() {
  local selected=() count
  if [[ -n ${1:-} ]]; then
    selected=(-L "^$1\$")
  fi
  build
  (install_packages "${TEST_PACKAGES[@]}") || say "no ${TEST_PACKAGES[*]}: the page of femxdem report is not opened in a browser"
  allow_mpi_everywhere
  count=$(ctest --test-dir "$BUILD" -N "${selected[@]}" | sed -n 's/^Total Tests: //p')
  if ((count == 0)); then
    fail "no test has the label $1; labels: $(ctest --test-dir "$BUILD" --print-labels | sed -n 's/^  //p' | xargs)" 2
  fi
  say "running $count tests"
  ctest --test-dir "$BUILD" --output-on-failure "${selected[@]}"
  say "$count tests passed"
}

demo() {
  build
  allow_mpi_everywhere
  local case_file=validation/biaxial/demo.toml status=0
  say "biaxial test on volume elements of spheres, 2 ranks: $case_file"
  mpirun -n 2 "$BUILD/femxdem" run "$case_file" --out out/demo --overwrite || status=$?
  if ((status != 0 && status != 3)); then
    fail "the demo ended with status $status; see out/demo/log.txt" "$status"
  fi
  say "the single volume element on the same path"
  "$BUILD/femxdem" ve path validation/biaxial/demo_ve.toml --out out/demo_ve --overwrite
  say "figures"
  "$BUILD/femxdem" plot out/demo --ve out/demo_ve
  "$BUILD/femxdem" report out/demo --ve out/demo_ve
  cat <<'TEXT'
out/demo/report.html      all of the following on one page, for a browser; needs no network
out/demo/curve.png        axial stress over axial strain: the specimen over its single volume element
out/demo/maps_*.png       where the strain has gone: second invariant, volume change, porosity, cost
out/demo/convergence.png  evaluations of all volume elements in each step
out/demo/results.xdmf     everything, for ParaView; history.csv and summary.json are beside it
TEXT
  if ((status == 3)); then
    fail "the demo stopped early, not converged; the figures show the steps up to there, out/demo/log.txt says why" 3
  fi
}

case "${1:-}" in
  build) build ;;
  demo) demo ;;
  test) run_tests "${2:-}" ;;
  install) install_program "${2:-}" ;;
  *)
    usage
    exit 2
    ;;
esac
