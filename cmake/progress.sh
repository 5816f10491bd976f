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
