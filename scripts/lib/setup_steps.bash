# shellcheck shell=bash disable=SC2154 # $ws and $check come from scripts/setup
# The steps of scripts/setup, and how it talks. Sourced with $ws set and as the working folder.

logs=logs
stamp_file=.setup-stamp
steps_done=0
# A package of the user's home must not stand in for one of the workspace.
export PYTHONNOUSERSITE=1
plain_path=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin

fail() {
  printf "${program:-scripts/setup}: %s\n" "$@" >&2
  exit 1
}

# With `sudo scripts/setup` only the Debian packages are root's business; the workspace stays the user's.
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

# step TITLE LOG COMMAND...: run it, show that it lives, and how long it took; on failure the end of its log.
step() {
  local title=$1 log=$logs/setup-$2.log started=$SECONDS pid code=0
  shift 2
  [ -d "$logs" ] || as_user mkdir -p "$logs"
  echo "==> $title"
  # A process group of its own, so that an interrupt can end all of it.
  set -m
  "$@" </dev/null > >(as_user tee "$log" >/dev/null) 2>&1 &
  pid=$!
  set +m
  trap 'kill -- -"$pid" 2>/dev/null; wait "$pid" 2>/dev/null; echo; fail "stopped by you; call it again to go on"' INT TERM
  show_progress "$pid" "$log" "$started"
  wait "$pid" || code=$?
  trap - INT TERM
  if [ $code != 0 ]; then
    tail -n 30 "$log" >&2
    fail "this step failed (code $code): $title" "the whole log: $ws/$log"
  fi
  steps_done=$((steps_done + 1))
  echo "    done in $((SECONDS - started)) s"
}

show_progress() {
  local pid=$1 log=$2 started=$3 ticks=0 every=100 line
  [ ! -t 1 ] || every=10
  while kill -0 "$pid" 2>/dev/null; do
    sleep 0.1
    ticks=$((ticks + 1))
    [ $((ticks % every)) = 0 ] || continue
    line=$(tail -n 1 "$log" 2>/dev/null | tr -d '\r' | cut -c1-90 || true)
    if [ -t 1 ]; then printf '\r\033[K    %3d s  %s' $((SECONDS - started)) "$line"; else printf '    %3d s  %s\n' $((SECONDS - started)) "$line"; fi
  done
  [ ! -t 1 ] || printf '\r\033[K'
}

# Only there do ROS 1 packages with these names and versions exist.
refuse_other_systems() {
  local os_release=${HRIC_OS_RELEASE:-/etc/os-release} name codename
  name=$(. "$os_release" && echo "${PRETTY_NAME:-unknown}")
  codename=$(. "$os_release" && echo "${DEBIAN_CODENAME:-${VERSION_CODENAME:-}}")
  [ "$codename" != bookworm ] || return 0
  fail "this machine runs $name. ROS 1 comes from the packages of Debian 12 (bookworm); nothing was changed." \
    "Ubuntu 20.04 with ROS Noetic is not supported: its Python 3.8 is too old for the pinned packages." \
    "On any Linux with Docker:  docker compose -f docker/compose.yaml up --build"
}

# The environment and the build tree hold absolute paths.
notice_moved_workspace() {
  local home
  if [ -f build/CMakeCache.txt ]; then
    home=$(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' build/CMakeCache.txt)
    if [ "$home" != "$ws/src" ] && ! $check; then
      echo "==> The workspace moved here from ${home%/src}: its build and .venv are made anew"
      rm -rf build devel .venv
    fi
  fi
}

# Names in scripts/apt-packages.txt that dpkg does not call installed; $1 = no leaves out the marked gui section.
missing_packages() {
  local wanted last='$'
  [ "$1" = yes ] || last='/^# \[gui\]/'
  mapfile -t wanted < <(sed "1,${last}!d; /^#/d" scripts/apt-packages.txt | sort)
  comm -23 <(printf '%s\n' "${wanted[@]}") \
    <(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null | sed -n 's/^installed //p' | sort)
}

# Whatever changes the build: messages, CMake files, C and C++, the list of executables.
build_inputs() {
  find src -mindepth 2 \( -name CMakeLists.txt -o -name package.xml -o -name setup.py -o -name '*.msg' -o -name '*.srv' \
    -o -name '*.action' -o -name '*.cfg' -o -name '*.cmake' -o -name '*.[ch]' -o -name '*.cpp' \) -print0 | sort -z | xargs -0 sha256sum
  find src -path '*/nodes/*' -not -path '*/__pycache__/*' | sort
  cat scripts/build
}

report_missing() {
  local need_python=$1 need_build=$2
  shift 2
  [ $# = 0 ] || echo "missing: $# Debian packages: $*"
  ! $need_python || echo "missing: the Python environment .venv, or it is not up to date with scripts/requirements.txt"
  ! $need_build || echo "missing: the build, or it is not up to date"
  if [ $# != 0 ] || $need_python || $need_build; then
    echo "run scripts/setup"
    return 1
  fi
  echo "nothing is missing"
}

install_packages() {
  local root=()
  if [ "$EUID" != 0 ]; then
    command -v sudo >/dev/null || fail "$# Debian packages are missing and this account is not root, nor is there sudo. As root:" "  $ws/scripts/setup --system"
    echo "==> $# Debian packages are missing; sudo may ask for your password"
    sudo -v || fail "sudo refused. Let somebody with the right call:  $ws/scripts/setup --system"
    root=(sudo)
  fi
  step "Reading the package lists" apt-update "${root[@]}" env PATH=$plain_path apt-get -q update
  step "Installing $# Debian packages and what they need (1 to 3 minutes)" apt-install "${root[@]}" env PATH=$plain_path DEBIAN_FRONTEND=noninteractive \
    apt-get -q install -y --no-install-recommends "$@"
}

# Debian's own Python, whatever stands first in PATH: ROS's Python packages are built for it.
install_python() {
  if ! grep -qs '^include-system-site-packages = true' .venv/pyvenv.cfg || ! grep -qs '^home = /usr/bin' .venv/pyvenv.cfg || [ ! -x .venv/bin/python3 ]; then
    step "Making the Python environment .venv" venv as_user env PATH=$plain_path /usr/bin/python3 -m venv --clear --system-site-packages .venv
  fi
  step "Installing the pinned Python packages (1 minute)" pip as_user env PATH=$plain_path .venv/bin/python3 -m pip install \
    --disable-pip-version-check --progress-bar off -r scripts/requirements.txt
  check_python
}

# Two packages that others drag in silently in the wrong version.
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
