# Sourced by scripts that start a system of processes and leave nothing behind: apps/demo and apps/stress/mission/run.
# The sourcing script sets root, the project's folder, and say, its name in messages.
source "$root/cmake/progress.sh"

refuse() {
    printf '%s: %s (apps/demo --help shows all options)\n' "$say" "$1" >&2
    exit 2
}

seconds_of() {
    [[ "$1" =~ ^([0-9]{1,6})(s|m|h|)$ ]] || refuse "--for takes a time such as 30s or 2m, not '$1'"
    local factor=1
    case "${BASH_REMATCH[2]}" in m) factor=60 ;; h) factor=3600 ;; esac
    local seconds=$((10#${BASH_REMATCH[1]} * factor))
    ((seconds >= 5 && seconds <= 86400)) || refuse "--for takes 5 seconds to 24 hours, not '$1'"
    echo "$seconds"
}

# read_options WORD...: into length, wind, speedup, port, verbose, mission, seed, store, out and boats.
read_options() {
    length='' wind='' speedup=1 port='' verbose=false mission='' seed='' store=sqlite out='' boats=1
    while (($#)); do
        case "$1" in
            --verbose) verbose=true; shift; continue ;;
            --for | --wind | --speedup | --port | --mission | --seed | --store | --out | --boats) (($# >= 2)) || refuse "$1 needs a value" ;;
            *) refuse "unknown argument: $1" ;;
        esac
        case "$1" in
            --for) length="$(seconds_of "$2")" || exit 2 ;;
            --wind)
                [[ -f "$2" && -r "$2" ]] || refuse "--wind: there is no file '$2' to read"
                wind="$(readlink -f "$2")"
                ;;
            --speedup)
                [[ "$2" =~ ^[0-9]{1,3}(\.[0-9]+)?$ ]] && awk -v n="$2" 'BEGIN { exit !(n >= 0.1 && n <= 100) }' || refuse "--speedup takes 0.1 to 100, not '$2'"
                speedup="$2"
                ;;
            --port)
                [[ "$2" =~ ^[0-9]{1,5}$ ]] && ((10#$2 <= 65535)) || refuse "--port takes 0 (any free one) to 65535, not '$2'"
                port="$((10#$2))"
                ;;
            --mission)
                [[ "$2" == stress ]] || refuse "there is no mission '$2': stress"
                mission="$2"
                ;;
            --seed)
                [[ "$2" =~ ^[0-9]{1,18}$ ]] || refuse "--seed takes a number, not '$2'"
                seed="$2"
                ;;
            --store)
                [[ "$2" == sqlite || "$2" == postgresql ]] || refuse "--store takes sqlite or postgresql, not '$2'"
                store="$2"
                ;;
            --boats)
                [[ "$2" =~ ^[0-9]{1,2}$ ]] && ((10#$2 >= 1 && 10#$2 <= 30)) || refuse "--boats takes 1 to 30, not '$2'"
                boats="$((10#$2))"
                ;;
            --out)
                [[ -n "$2" && ! ( -e "$2" && ! -d "$2" ) ]] || refuse "--out takes a folder, not '$2'"
                out="$(readlink -m "$2")"
                ;;
        esac
        shift 2
    done
    [[ -n "$mission" || "$seed$store$out" == sqlite ]] || refuse "--seed, --store and --out belong to --mission stress"
    [[ -z "$mission" || "$boats" == 1 ]] || refuse "--mission stress has one boat"
}

# build_programs TARGET...: sets bin to their folder.
build_programs() {
    bin="${ATIRMA_BIN:-}" # programs that are built already, of whatever build
    [[ -z "$bin" ]] || return 0
    local installed=0
    "$root/cmake/install-packages" build run || installed=$?
    ((installed == 0)) || exit "$installed"
    bin="$root/build/release/bin"
    "$root/cmake/build" release -DISE_BUILD_TESTS=OFF -DISE_BUILD_BENCH=OFF "$@" || { echo "$say: the build failed" >&2; exit 1; }
}

# --- the processes --------------------------------------------------------------------------------------------------

names=() pids=()
declare -A command_of

# Makes work, a folder of this script's own, which goes with it.
open_folder() {
    local old
    # A script that was killed could not take its folder along: the next one does. Whoever works in a folder holds its lock.
    for old in "${TMPDIR:-/tmp}"/atirma-demo.*; do
        [[ -O "$old" && -f "$old/lock" ]] && flock --nonblock "$old/lock" true && rm -rf -- "$old"
    done
    work="$(mktemp -d "${TMPDIR:-/tmp}/atirma-demo.XXXXXX")"
    exec {said}>&2 # messages go there, also where those of the shell are not wanted
    trap clean_up EXIT
    # Without --for, Ctrl-C is how it ends.
    trap '[[ -z "$length" ]] && exit 0; exit 130' INT
    trap 'exit 143' TERM HUP
    trap 'exit 141' PIPE
    exec {held}>"$work/lock.new"
    flock "$held"
    mv "$work/lock.new" "$work/lock"
}

# Only what this script started, and is still its child: a process id may have gone to somebody else meanwhile.
is_mine() {
    local pid="$1" parent
    [[ "$pid" =~ ^[0-9]+$ ]] && ((pid > 1)) || return 1
    parent="$(ps -o ppid= -p "$pid" 2>/dev/null)" || return 1
    ((parent == $$))
}

# It runs; one that has ended, and was not waited for, does not.
runs() { is_mine "$1" && [[ "$(ps -o stat= -p "$1" 2>/dev/null)" != Z* ]]; }

clean_up() {
    local code=$? pid i
    set +e # whoever read along may be gone
    trap '' INT TERM HUP PIPE
    trap - EXIT
    # In the opposite order, so that each can still say goodbye to what it depends on.
    for ((i = ${#pids[@]} - 1; i >= 0; --i)); do
        pid="${pids[i]}"
        if is_mine "$pid"; then kill -TERM "$pid" 2>/dev/null || true; fi
    done
    for ((i = 0; i < 150; ++i)); do
        local left=false
        for pid in "${pids[@]}"; do if runs "$pid"; then left=true; fi; done
        $left || break
        sleep 0.1
    done
    for i in "${!pids[@]}"; do
        pid="${pids[i]}"
        if runs "$pid"; then
            echo "$say: ${names[i]} did not end in time; it is killed" >&2
            kill -KILL "$pid" 2>/dev/null || true
        fi
    done
    wait 2>/dev/null
    rm -rf -- "$work"
    exit "$code"
}

# start NAME COMMAND...: its output goes to a file. In a session of its own: Ctrl-C at the terminal is for this script, which
# stops the others in order. Should this script be killed, they end too.
start() {
    local name="$1"
    shift
    command_of[$name]="$(printf '%q ' "$@")"
    launch "$name" "$@"
    names+=("$name")
    pids+=("$!")
}

launch() {
    local name="$1"
    shift
    local alone=(setpriv --pdeathsig TERM setsid "$@")
    if $verbose; then
        (exec "${alone[@]}" >"$work/$name.out" 2> >(sed -u "s/^/[$name] /" >&"$said") {said}>&-) &
    else
        (exec "${alone[@]}" >"$work/$name.out" 2>>"$work/$name.log" {said}>&-) &
    fi
}

# failed MESSAGE [NAME]: with the last that the process of that name logged, or each.
failed() {
    echo "$say: $1" >&"$said"
    local file left
    left="$(df --output=avail -k "$work" | tail -n1)"
    ((left >= 64)) || echo "$say: there is no space left in ${TMPDIR:-/tmp}; TMPDIR=FOLDER chooses another place" >&"$said"
    for file in "$work"/${2:-*}.log; do
        [[ -s "$file" ]] && { echo "--- $(basename "$file" .log)"; tail -n 15 "$file"; } >&"$said"
    done
    exit 1
}

# wait_for NAME PATTERN: the first match in what NAME printed; fails when NAME ended, or says nothing for a minute.
wait_for() {
    local name="$1" pattern="$2" index found
    index="$(index_of "$name")"
    local attempt
    for ((attempt = 0; attempt < 1200; ++attempt)); do
        found="$(grep -oE -m1 -- "$pattern" "$work/$name.out" 2>/dev/null | head -n1)" || true
        if [[ -n "$found" ]]; then
            echo "$found"
            return 0
        fi
        kill -0 "${pids[index]}" 2>/dev/null || return 1
        sleep 0.05
    done
    return 1
}

index_of() {
    local i
    for i in "${!names[@]}"; do [[ "${names[i]}" == "$1" ]] && { echo "$i"; return 0; }; done
    return 1
}

# The name server, on a free port, where it is found again if it is started once more.
start_name_server() {
    start name-server "$bin/ise_name_server" --listen tcp://127.0.0.1:0 --fresh
    server="$(wait_for name-server 'tcp://[^ ]+')" || failed "the name server did not start" name-server
    export ISE_NAME_SERVER="$server"
    command_of[name-server]="$(printf '%q ' "$bin/ise_name_server" --listen "$server")"
}

is_free() { ! (exec 3<>"/dev/tcp/127.0.0.1/$1") 2>/dev/null; }

# free_ports N: different ports of the loopback interface on which nobody listens, a line each.
free_ports() {
    local port taken=' ' left="$1"
    for _ in {1..500}; do
        ((left > 0)) || return 0
        port=$((RANDOM % 12000 + 20000)) # the system gives connections those from 32768 on
        [[ "$taken" != *" $port "* ]] && is_free "$port" || continue
        taken+="$port "
        echo "$port"
        left=$((left - 1))
    done
    ((left == 0))
}
