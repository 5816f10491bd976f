#pragma once

namespace ise::cli {

// What of the completion scripts is the same for any commands; @VALUES@, @CASES@ and @LINES@ are filled in.
// Names come from other machines and end up on a command line: all scripts pass over what is no plain name.
inline constexpr const char* bash_script = R"script(# Completion of ise for bash: eval "$(ise completion bash)"
_ise_names() {
    local word
    while IFS= read -r word; do
        [[ $word =~ ^[A-Za-z0-9_./-]+$ && $word == "$current"* ]] && COMPREPLY+=("$word")
    done < <("$@" 2>/dev/null)
}
_ise() {
    local line=${COMP_LINE:0:COMP_POINT} current="" option="" command="" name="" word options=""
    local -a words=() server=() places=()
    local -i place=0
    read -ra words <<< "$line"
    if [[ $line != *[[:space:]] ]]; then
        current=${words[-1]}
        unset 'words[-1]'
    fi
    for word in "${words[@]:1}"; do
        if [[ -n $option ]]; then
            [[ $option == --name-server ]] && server=(--name-server "$word")
            option=""
            continue
        fi
        case $word in
            --name-server=*) server=("$word") ;;
            @VALUES@) option=$word ;;
            -?*) ;;
            *)
                if [[ -z $command ]]; then
                    command=$word
                else
                    place+=1
                    name=$word
                fi
                ;;
        esac
    done
    COMPREPLY=()
    [[ -n $option ]] && return
    case $command in
@CASES@        *) return ;;
    esac
    if [[ $current == -* ]]; then
        mapfile -t COMPREPLY < <(compgen -W "$options" -- "$current")
        return
    fi
    case ${places[place]-} in
        NAME | PREFIX) _ise_names "${words[0]}" "${server[@]}" --timeout 1s list --names ;;
        SERVICE) _ise_names "${words[0]}" "${server[@]}" --timeout 1s describe --names "$name" ;;
        TYPE) _ise_names "${words[0]}" "${server[@]}" --timeout 1s start --types --names ;;
        INSTANCE) _ise_names "${words[0]}" "${server[@]}" --timeout 1s ps --names ;;
        PARAMETER) _ise_names "${words[0]}" "${server[@]}" --timeout 1s param list --names "$name" ;;
        FILE) mapfile -t COMPREPLY < <(compgen -f -- "$current") ;;
        *) mapfile -t COMPREPLY < <(compgen -W "${places[place]-}" -- "$current") ;;
    esac
}
complete -F _ise ise
)script";

inline constexpr const char* zsh_script = R"script(#compdef ise
# Completion of ise for zsh: eval "$(ise completion zsh)"
_ise() {
    local option="" command="" name="" word
    local -a server options places found
    local -i place=1
    for word in "${(@)words[2,CURRENT-1]}"; do
        if [[ -n $option ]]; then
            [[ $option == --name-server ]] && server=(--name-server "$word")
            option=""
            continue
        fi
        case $word in
            --name-server=*) server=("$word") ;;
            @VALUES@) option=$word ;;
            -?*) ;;
            *)
                if [[ -z $command ]]; then
                    command=$word
                else
                    place+=1
                    name=$word
                fi
                ;;
        esac
    done
    [[ -n $option ]] && return 1
    case $command in
@CASES@        *) return 1 ;;
    esac
    if [[ $words[CURRENT] == -* ]]; then
        _describe option options
        return
    fi
    case ${places[place]-} in
        NAME|PREFIX) found=("${(@f)$($words[1] $server --timeout 1s list --names 2>/dev/null)}") ;;
        SERVICE) found=("${(@f)$($words[1] $server --timeout 1s describe --names $name 2>/dev/null)}") ;;
        TYPE) found=("${(@f)$($words[1] $server --timeout 1s start --types --names 2>/dev/null)}") ;;
        INSTANCE) found=("${(@f)$($words[1] $server --timeout 1s ps --names 2>/dev/null)}") ;;
        PARAMETER) found=("${(@f)$($words[1] $server --timeout 1s param list --names $name 2>/dev/null)}") ;;
        FILE) _files; return ;;
        COMMAND) _describe command commands; return ;;
        *) found=(${=places[place]-}) ;;
    esac
    found=("${(@M)found:#[A-Za-z0-9_./-]##}")
    compadd -a found
}
if [[ ${funcstack[1]-} == _ise ]]; then
    _ise "$@"
else
    compdef _ise ise
fi
)script";

inline constexpr const char* fish_script = R"script(# Completion of ise for fish: ise completion fish | source
function __ise_state --description 'command, place, name and name server before the cursor'
    set -l option ''
    set -l command ''
    set -l name ''
    set -l server ''
    set -l place 0
    for word in (commandline -opc)[2..-1]
        if test -n "$option"
            test "$option" = --name-server; and set server $word
            set option ''
            continue
        end
        switch $word
            case '--name-server=*'
                set server (string replace -- --name-server= '' $word)
            case @VALUES@
                set option $word
            case '-?*'
            case '*'
                if test -z "$command"
                    set command $word
                else
                    set place (math $place + 1)
                    set name $word
                end
        end
    end
    printf '%s\n' "$command" $place "$name" "$server"
end
function __ise_at --argument-names command place
    set -l state (__ise_state)
    test "$state[1]" = "$command"; and test -z "$place" -o "$state[2]" = "$place"
end
function __ise_names
    set -l state (__ise_state)
    set -l program (commandline -opc)[1]
    set -l server
    test -n "$state[4]"; and set server --name-server $state[4]
    set -l ask list --names
    switch "$argv[1]"
        case SERVICE
            set ask describe --names "$state[3]"
        case TYPE
            set ask start --types --names
        case INSTANCE
            set ask ps --names
        case PARAMETER
            set ask param list --names "$state[3]"
    end
    $program $server --timeout 1s $ask 2>/dev/null | string match -r '^[A-Za-z0-9_./-]+$'
end
complete -c ise -f
@LINES@)script";

} // namespace ise::cli
