# To be sourced: one line that tells how far something is. On a terminal it is rewritten in place; elsewhere a line every 10 %.

progress_said=-10

# progress PERCENT TEXT
progress() {
    local percent="$1" text="$2"
    if [[ -t 2 ]]; then
        printf '\r\e[K%3d %%  %.*s' "$percent" "$((${COLUMNS:-80} - 8))" "$text" >&2
    elif ((percent >= progress_said + 10)); then
        progress_said=$((percent - percent % 10))
        printf '%3d %%  %s\n' "$percent" "$text" >&2
    fi
}

# progress_end: what is printed next starts on a line of its own.
progress_end() {
    progress_said=-10
    if [[ -t 2 ]]; then printf '\r\e[K' >&2; fi
}

# SECONDS as "45 s", "3 min 05 s" or "2 h 10 min".
progress_time() {
    local s="$1"
    if ((s < 60)); then printf '%d s' "$s"
    elif ((s < 3600)); then printf '%d min %02d s' $((s / 60)) $((s % 60))
    else printf '%d h %02d min' $((s / 3600)) $((s / 60 % 60))
    fi
}

# progress_part DONE OF BEGAN TEXT: BEGAN is what SECONDS was; tells the time since then and, from the share that is done, the time left.
progress_part() {
    local done_="$1" of="$2" passed=$((SECONDS - $3)) text="$4"
    ((of > 0)) || return 0
    text+=", $(progress_time "$passed")"
    if ((done_ > 0 && done_ < of && passed >= 2)); then text+=", about $(progress_time $((passed * (of - done_) / done_))) left"; fi
    progress $((100 * done_ / of)) "$text"
}

# progress_lines TEXT REGEX [through]: reads lines. REGEX finds in them how many of how many things are done; each second the line
# tells it, `{}` in TEXT being "12 of 340". With `through` the lines are printed above it.
progress_lines() {
    local text="$1" regex="$2" through="${3:-}" line='' rest='' done_=0 of=0 began=$SECONDS code=0
    while :; do
        if IFS= read -r -t 1 line; then
            line="$rest$line" rest=''
            if [[ "$line" =~ $regex && "$line" != *Re-checking* ]]; then done_="${BASH_REMATCH[1]}" of="${BASH_REMATCH[2]}"; fi
            if [[ -n "$through" ]]; then
                [[ ! -t 2 ]] || printf '\r\e[K' >&2
                printf '%s\n' "$line"
            fi
        else
            code=$?
            rest+="$line"
            ((code > 128)) || break # else a second has passed without a line
        fi
        progress_part "$done_" "$of" "$began" "${text/\{\}/$done_ of $of}"
    done
    if [[ -n "$through" && -n "$rest" ]]; then printf '%s\n' "$rest"; fi
    progress_end
}

# progress_while TEXT SECONDS COMMAND...: runs a command that takes about so long, and returns its exit code. `progress_pid` is its
# process meanwhile.
progress_pid=''
progress_while() {
    local text="$1" length="$2" began=$SECONDS passed code=0
    shift 2
    "$@" &
    progress_pid=$!
    if [[ -t 2 ]]; then
        while kill -0 "$progress_pid" 2>/dev/null; do
            passed=$((SECONDS - began))
            ((passed < length)) || passed="$length"
            progress $((length > 0 ? 100 * passed / length : 100)) "$text, about $(progress_time $((length - passed))) left"
            sleep 1
        done
        progress_end
    fi
    wait "$progress_pid" || code=$?
    progress_pid=''
    return "$code"
}
