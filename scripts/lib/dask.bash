# shellcheck shell=bash
# To be sourced with "scheduler" or "worker" and its arguments: refuses ports that are open to other machines, runs scripts/setup, and executes dask.
ws=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
program=$1
shift
case " $* " in *" -h "* | *" --help "*) sed -n '2,/^[^#]/s/^# \{0,1\}//p' "$0"; exit ;; esac
[ -x /usr/bin/python3 ] || "$ws/scripts/setup" --with cluster
words=$(/usr/bin/python3 -BIS "$ws/scripts/lib/dask_doors.py" "$program" "$@")
mapfile -t words <<<"$words"
"$ws/scripts/setup" --with cluster
. "$ws/scripts/env"
# Dask then refuses all connections without encryption.
[ "${words[0]}" = plain ] || export DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION=true
exec dask "$program" "${words[@]:1}"
