# shellcheck shell=bash disable=SC2154 # $ws and $check come from scripts/setup
# The steps of scripts/setup, and its messages. To be sourced with the workspace as $ws and as working directory.

logs=logs
stamp_file=.setup-stamp
steps_done=0
# Packages in the user's home must not replace those of the workspace.
export PYTHONNOUSERSITE=1
plain_path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin

fail() {
  printf "${program:-scripts/setup}: %s\n" "$@" >&2
  exit 1
}

# With `sudo scripts/setup`, only Debian packages are installed as root; all files of the workspace are owned by the user.
as_user() {
  if [ "$EUID" = 0 ] && [ "${SUDO_UID:-0}" != 0 ]; then sudo -H -u "#$SUDO_UID" env PYTHONNOUSERSITE=1 "$@"; else "$@"; fi
}

hash_of() { printf '%s\n' "$@" | sha256sum | cut -c1-16; }

stamped() { [ ! -f "$stamp_file" ] || sed -n "s/^$1 //p" "$stamp_file"; }

stamp() {
  [ "$(stamped "$1")" != "$2" ] || return 0
  local rest=
  [ ! -f "$stamp_file" ] || rest=$(grep -v "^$1 " "$stamp_file" || true)
  printf '%s\n' "$1 $2" ${rest:+"$rest"} | as_user tee "$stamp_file" >/dev/null
}

# forget PREFIX: delete the stamps of steps whose names have this prefix, so that these steps are repeated.
forget() {
  local rest=
  [ ! -f "$stamp_file" ] || rest=$(grep -v "^$1" "$stamp_file" || true)
  printf '%s\n' "$rest" | as_user tee "$stamp_file" >/dev/null
}

# step TITLE LOG SHARE EXPECTED COMMAND...: run COMMAND and print its progress in percent (from `share_SHARE LOG`) and its duration; EXPECTED is the
# duration on two idle processors [s]. On failure print the end of the log and exit.
step() {
  local title=$1 log=$logs/setup-$2.log share=$3 expected=$4 started=$SECONDS pid code=0
  shift 4
  [ -d "$logs" ] || as_user mkdir -p "$logs"
  echo "==> $title"
  # Start the command in a separate process group, so that an interrupt can end all its processes.
  set -m
  "$@" </dev/null > >(as_user tee "$log" >/dev/null) 2>&1 &
  pid=$!
  set +m
  trap 'stop_step "$pid"' INT TERM
  show_progress "$pid" "$log" "$share" "$started" "$expected"
  wait "$pid" || code=$?
  trap - INT TERM
  if [ $code != 0 ]; then
    tail -n 30 "$log" >&2
    fail "this step failed with exit code $code: $title" "complete log: $ws/$log"
  fi
  steps_done=$((steps_done + 1))
  echo "    done in $((SECONDS - started)) s"
}

# On Ctrl-C: end all processes of a step and wait for them, since a package manager completes its present file first.
stop_step() {
  local waited=0
  kill -- -"$1" 2>/dev/null || true
  while kill -0 -- -"$1" 2>/dev/null && [ $waited -lt 600 ]; do
    sleep 0.1
    waited=$((waited + 1))
  done
  printf '\n%s: stopped by Ctrl-C; call it again to continue\n' "${program:-scripts/setup}" >&2
  exit 130
}

show_progress() {
  local pid=$1 log=$2 share=$3 started=$4 expected=$5 ticks=0 every=100 line estimate
  [ ! -t 1 ] || every=10
  while kill -0 "$pid" 2>/dev/null; do
    sleep 0.1
    ticks=$((ticks + 1))
    [ $((ticks % every)) = 0 ] || continue
    estimate=" of about $expected s on an idle machine"
    [ $((SECONDS - started)) -lt "$expected" ] || estimate=
    line=$(printf '%3d %%  %d s%s' "$("share_$share" "$log" 2>/dev/null || echo 0)" $((SECONDS - started)) "$estimate")
    if [ -t 1 ]; then printf '\r\033[K    %s' "$line"; else printf '    %s\n' "$line"; fi
  done
  [ ! -t 1 ] || printf '\r\033[K'
}

# Progress of a step in percent, from its log.
share_apt() { # from apt's status lines: downloads count one third, the work of dpkg two thirds
  awk -F: '/^dlstatus:/ { fetched = $3 } /^pmstatus:/ { installed = $3 } END { print int(fetched / 3 + installed * 2 / 3) }' "$1"
}
share_pip() { # collecting packages counts one half, installing them the other
  local wanted found placed
  wanted=$(grep -c == "scripts/requirements${part_file:-}.txt")
  found=$(grep -c '^Collecting' "$1")
  if grep -q '^Installing collected' "$1"; then
    placed=$(find "${environment:-.venv}"/lib/python3*/site-packages -maxdepth 1 -name '*.dist-info' -newer "$1.begin" | wc -l)
    echo $((50 + (placed < wanted ? placed * 49 / wanted : 49)))
  else
    echo $((found >= wanted ? 49 : found * 49 / wanted))
  fi
}
share_make() { # the configuration by cmake counts one quarter
  awk '/^-- \+\+\+ processing catkin package/ { seen++ } match($0, /^\[ *[0-9]+%\]/) { made = substr($0, 2, RLENGTH - 3) + 0 }
    END { print made ? int(25 + made * 0.75) : (seen > 24 ? 24 : seen + 0) }' "$1"
}

# The Debian versions that have packages of ROS 1 with these names.
refuse_other_systems() {
  local os_release=${HRIC_OS_RELEASE:-/etc/os-release} name codename
  name=$(. "$os_release" && echo "${PRETTY_NAME:-unknown}")
  codename=$(. "$os_release" && echo "${DEBIAN_CODENAME:-${VERSION_CODENAME:-}}")
  case $codename in bookworm | trixie) return ;; esac
  fail "this machine runs $name. ROS 1 comes from the packages of Debian 12 (bookworm) or 13 (trixie); nothing was changed." \
    "Ubuntu 20.04 with ROS Noetic is not supported: its Python 3.8 is too old for the pinned packages." \
    "On any Linux with Docker:  docker compose -f docker/compose.yaml up --build"
}

# The Python environment and the build tree contain absolute paths, so they must be made again after a move.
notice_moved_workspace() {
  local home
  if [ -f build/CMakeCache.txt ]; then
    home=$(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' build/CMakeCache.txt)
    if [ "$home" != "$ws/src" ] && ! $check; then
      echo "==> The workspace was moved here from ${home%/src}: its build and .venv are made again"
      rm -rf build devel .venv
    fi
  fi
}

# Print the packages in scripts/apt-packages.txt that are not installed: those that running needs, and those of the given sections.
missing_packages() {
  local wanted
  mapfile -t wanted < <(awk -v sections=" $* " '
    /^# \[/ { split($0, name, /[][]/); left_out = !index(sections, " " name[2] " ") }
    !/^#/ && !left_out' scripts/apt-packages.txt | sort -u)
  comm -23 <(printf '%s\n' "${wanted[@]}") \
    <(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null | sed -n 's/^installed //p' | sort)
}

requirements_of() { if [ "$1" = run ]; then echo scripts/requirements.txt; else echo "scripts/requirements-$1.txt"; fi; }

locked_of() { echo "scripts/locked/$1.txt"; }

python_key() { hash_of "$ws" "$(cat "$(locked_of run)" "$(locked_of "$1")")"; }

# Print the hashes of all files that affect the build. Packages with Python code only are not built, so they are left out.
build_inputs() {
  local compiled
  mapfile -t compiled < <(find src -mindepth 3 \( -name '*.msg' -o -name '*.srv' -o -name '*.action' -o -name '*.cfg' -o -name '*.[ch]' \
    -o -name '*.cpp' \) | cut -d/ -f1,2 | sort -u)
  find "${compiled[@]}" \( -name CMakeLists.txt -o -name package.xml -o -name setup.py -o -name '*.msg' -o -name '*.srv' -o -name '*.action' \
    -o -name '*.cfg' -o -name '*.cmake' -o -name '*.[ch]' -o -name '*.cpp' \) -print0 | sort -z | xargs -0 sha256sum
  cat scripts/build
}

report_missing() {
  [ ${#missing[@]} = 0 ] || echo "missing: ${#missing[@]} Debian packages: ${missing[*]}"
  [ ${#need_python[@]} = 0 ] || echo "missing or outdated: the Python environment .venv, by $(requirements_of "${need_python[0]}")"
  ! $need_build || echo "missing or outdated: the build"
  if [ ${#missing[@]} != 0 ] || [ ${#need_python[@]} != 0 ] || $need_build; then
    echo "run scripts/setup${parts[*]:+ --with ${parts[*]}}"
    return 1
  fi
  echo "nothing is missing"
}

install_packages() {
  local root=() apt
  if [ "$EUID" != 0 ]; then
    command -v sudo >/dev/null || fail "${#missing[@]} Debian packages are missing, this account is not root, and sudo is not installed. Call as root:" "  $ws/scripts/setup --system"
    echo "==> ${#missing[@]} Debian packages are missing; sudo may ask for your password"
    sudo -v || fail "sudo refused. Ask an administrator to call:  $ws/scripts/setup --system"
    root=(sudo)
  fi
  # Wait if another program is installing packages.
  apt=("${root[@]}" env "PATH=$plain_path" DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300 -o APT::Status-Fd=1)
  if [ -n "$(dpkg --audit 2>/dev/null)" ]; then
    step "Completing an interrupted installation of dpkg" dpkg apt 10 "${root[@]}" env PATH=$plain_path DEBIAN_FRONTEND=noninteractive dpkg --configure -a
    step "Repairing incompletely installed dependencies" apt-mend apt 10 "${apt[@]}" install -y --fix-broken
  fi
  step "Reading the package lists" apt-update apt 10 "${apt[@]}" update
  print_sizes
  step "Installing ${#missing[@]} Debian packages and what they need" apt-install apt 120 "${apt[@]}" install -y --no-install-recommends "${missing[@]}"
}

# Print the sizes of the packages that apt will download and unpack, and of the later steps.
print_sizes() {
  env PATH=$plain_path apt-get install --assume-no --no-install-recommends "${missing[@]}" 2>/dev/null |
    sed -n 's/^Need to get \(.*\) of archives.*/    download: \1/p; s/^After this operation, \(.*\) of additional.*/    disk space: \1, and 1.3 GB in .venv and 0.1 GB for the build/p' || true
}

# Use Debian's Python, whichever is first in PATH, since ROS's Python packages are built for it.
install_python() {
  local part index
  if ! grep -qs '^include-system-site-packages = true' .venv/pyvenv.cfg || ! grep -qs '^home = /usr/bin' .venv/pyvenv.cfg ||
    ! .venv/bin/python3 -m pip --version >/dev/null 2>&1; then
    forget python-
    step "Creating the Python environment .venv" venv none 10 as_user env PATH=$plain_path /usr/bin/python3 -m venv --clear --system-site-packages .venv
  elif [ "$(stamped doing)" = python ]; then
    as_user .venv/bin/python3 scripts/lib/mend_venv.py
  fi
  stamp doing python
  for part in "${need_python[@]}"; do
    index=() part_file=''
    # PyTorch has its build without CUDA on an index of its own.
    [ "$part" != learning ] || index=(--extra-index-url https://download.pytorch.org/whl/cpu)
    [ "$part" = run ] || part_file=-$part
    [ -d "$logs" ] || as_user mkdir -p "$logs"
    as_user touch "$logs/setup-pip.log.begin"
    step "Installing the pinned Python packages$(about_part "$part")" pip pip 60 as_user env PATH=$plain_path .venv/bin/python3 -m pip install \
      --disable-pip-version-check --progress-bar off --no-deps --require-hashes "${index[@]}" -r "$(locked_of "$part")"
    if [ "$part" = run ]; then
      check_python
      if ! .venv/bin/python3 -c 'import pybullet_data' 2>/dev/null; then install_meshes; fi
      # Remove unused files: models that are part of PyBullet, except for the Panda's meshes and those used by tests; headers of the rigid-body library.
      as_user find .venv/lib/python3*/site-packages/pybullet_data -mindepth 1 -maxdepth 1 ! -name __init__.py ! -name franka_panda \
        ! -name racecar ! -name kuka_iiwa ! -name 'duck*' -exec rm -rf {} +
      as_user rm -rf .venv/lib/python3*/site-packages/cmeel.prefix/include
    fi
    stamp "python-$part" "$(python_key "$part")"
  done
  stamp doing nothing
}

# The Panda's meshes are part of PyBullet. If PyBullet has no wheel for this Python, unpack them from the wheel for Python 3.11, which has the same files.
install_meshes() {
  local wheel=build/pybullet
  as_user mkdir -p build
  sed -n '/^pybullet==/,/[^\\]$/p' "$(locked_of run)" | sed 's/ ;[^\\]*//' | as_user tee build/pybullet.txt >/dev/null
  step "Installing the Panda's meshes; PyBullet has no package for this Python, so MuJoCo is the default engine" meshes none 20 as_user env PATH=$plain_path \
    .venv/bin/python3 -m pip install --disable-pip-version-check --progress-bar off --no-deps --require-hashes --upgrade -r build/pybullet.txt \
    --target $wheel --only-binary=:all: --python-version 3.11 --platform "manylinux2014_$(uname -m)"
  as_user cp -r $wheel/pybullet_data .venv/lib/python3*/site-packages/
  as_user rm -rf $wheel build/pybullet.txt
}

share_none() { echo 0; }

about_part() {
  case $1 in
    run) echo " (1.3 GB)" ;;
    checks) echo " for tests and lint (0.6 GB)" ;;
    pictures) echo " for pictures of OpenSim models and films of runs (0.7 GB)" ;;
    search) echo " for the search of worst cases (40 MB)" ;;
    cluster) echo " for sweeps on a cluster (45 MB)" ;;
    mutation) echo " for scripts/mutate (45 MB)" ;;
    learning) echo " for learning (1.2 GB)" ;;
    wheel) echo " for scripts/wheel (2 MB)" ;;
  esac
}

# After an interruption build again from the start, since make would treat incomplete files of a killed compiler as finished.
build() {
  if [ "$(stamped doing)" = build ]; then as_user rm -rf build devel; fi
  stamp doing build
  step "Building the messages and the nodes" build make 60 as_user scripts/build
  stamp build "$build_key"
  stamp doing nothing
}

# Check the versions of two packages that dependencies of others could silently change.
check_python() {
  local wanted found
  wanted=$(sed -n 's/^numpy==//p' scripts/requirements.txt)
  found=$(.venv/bin/python3 -c 'import numpy; print(numpy.__version__)')
  [ "$found" = "$wanted" ] || fail "numpy is $found instead of $wanted. Remove .venv and call scripts/setup again."
  found=$(.venv/bin/python3 -c 'import em; print(em.__version__)')
  case $found in
    3.*) ;;
    *) fail "the message generators need empy 3, .venv has $found:  .venv/bin/python3 -m pip uninstall empy" ;;
  esac
}
