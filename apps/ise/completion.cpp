#include "completion.hpp"

#include <fmt/format.h>

#include <set>
#include <string_view>
#include <utility>

namespace ise::cli {
namespace {

// Names come from other machines and end up on a command line: all scripts pass over what is no plain name.
constexpr const char* bash_script = R"script(# Completion of ise for bash: eval "$(ise completion bash)"
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
                    ((place == 1)) && name=$word
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
        *) mapfile -t COMPREPLY < <(compgen -W "${places[place]-}" -- "$current") ;;
    esac
}
complete -F _ise ise
)script";

constexpr const char* zsh_script = R"script(#compdef ise
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
                    ((place == 2)) && name=$word
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

constexpr const char* fish_script = R"script(# Completion of ise for fish: ise completion fish | source
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
                    test $place -eq 1; and set name $word
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
    if test "$argv[1]" = SERVICE
        $program $server --timeout 1s describe --names "$state[3]" 2>/dev/null | string match -r '^[A-Za-z0-9_./-]+$'
    else
        $program $server --timeout 1s list --names 2>/dev/null | string match -r '^[A-Za-z0-9_./-]+$'
    end
end
complete -c ise -f
@LINES@)script";

std::string filled(std::string script, std::string_view place, const std::string& text) {
    if (auto at = script.find(place); at != std::string::npos) script.replace(at, place.size(), text);
    return script;
}

// Between single quotes; `:` parts name and description for zsh.
std::string quoted(const std::string& text, std::string_view quote, bool escape_colons = false) {
    std::string out = "'";
    for (char letter : text) {
        if (letter == '\'') out += quote;
        else if (letter == ':' && escape_colons) out += "\\:";
        else out += letter;
    }
    return out + "'";
}

std::set<std::string> options_with_values(const command_info& from) {
    std::set<std::string> names;
    for (const auto& one : from.options)
        if (one.takes_value) names.insert(one.names.begin(), one.names.end());
    for (const auto& below : from.commands) names.merge(options_with_values(below));
    return names;
}

std::string joined(const std::set<std::string>& names, std::string_view between) {
    std::string text;
    for (const auto& name : names) text += (text.empty() ? "" : std::string(between)) + name;
    return text;
}

// What completes a place: its name, which the scripts know, or its choices.
std::string place_word(const option_info& place) {
    if (place.choices.empty()) return place.names.front();
    std::string words;
    for (const auto& one : place.choices) words += (words.empty() ? "" : " ") + one;
    return words;
}

// Words for a JSON text are the user's own.
bool completes(const option_info& place) { return place.names.front() != "JSON"; }

std::vector<option_info> all_options(const command_info& program, const command_info& command) {
    auto all = command.options;
    for (const auto& global : program.options) {
        bool known = false;
        for (const auto& own : command.options) known = known || own.names == global.names;
        if (!known) all.push_back(global);
    }
    return all;
}

std::string bash_case(const command_info& program, const command_info& command, bool top) {
    std::string options, places;
    for (const auto& one : all_options(program, command))
        for (const auto& name : one.names) options += (options.empty() ? "" : " ") + name;
    for (const auto& below : command.commands) places += (places.empty() ? "" : " ") + below.name;
    if (!places.empty()) places = "\"" + places + "\"";
    for (const auto& place : command.places) places += fmt::format("{}\"{}\"", places.empty() ? "" : " ", completes(place) ? place_word(place) : "");
    return fmt::format("        {}) options=\"{}\" places=({}) ;;\n", top ? "\"\"" : command.name, options, places);
}

std::string zsh_case(const command_info& program, const command_info& command, bool top) {
    std::string options, places;
    for (const auto& one : all_options(program, command))
        for (const auto& name : one.names) options += quoted(name + "\n" + one.description, "'\\''", true).replace(1 + name.size(), 1, ":") + " ";
    if (top) {
        std::string commands;
        for (const auto& below : command.commands) commands += quoted(below.name + ":" + below.description, "'\\''") + " ";
        return fmt::format("        \"\") options=({}) places=(COMMAND); local -a commands=({}) ;;\n", options, commands);
    }
    for (const auto& place : command.places) places += fmt::format("\"{}\" ", completes(place) ? place_word(place) : "");
    return fmt::format("        {}) options=({}) places=({}) ;;\n", command.name, options, places);
}

std::string fish_option(const option_info& one, const std::string& condition) {
    std::string line = "complete -c ise" + condition;
    for (const auto& name : one.names) line += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    if (one.takes_value) line += " -x";
    return line + " -d " + quoted(one.description, "\\'") + "\n";
}

std::string fish_lines(const command_info& program) {
    std::string lines;
    for (const auto& global : program.options) lines += fish_option(global, "");
    for (const auto& command : program.commands) {
        lines += fmt::format("complete -c ise -n '__ise_at \"\"' -a {} -d {}\n", command.name, quoted(command.description, "\\'"));
        for (const auto& one : command.options)
            if (one.names.front() != "--help") lines += fish_option(one, fmt::format(" -n '__ise_at {}'", command.name));
        for (std::size_t at = 0; at < command.places.size(); ++at) {
            const auto& place = command.places[at];
            if (!completes(place)) continue;
            auto words = place.choices.empty() ? fmt::format("(__ise_names {})", place.names.front()) : place_word(place);
            lines += fmt::format("complete -c ise -n '__ise_at {} {}' -a '{}'\n", command.name, at, words);
        }
    }
    return lines;
}

} // namespace

std::string completion_script(const command_info& program, const std::string& shell) {
    auto values = options_with_values(program);
    if (shell == "fish") return filled(filled(fish_script, "@VALUES@", joined(values, " ")), "@LINES@", fish_lines(program));
    auto one_case = shell == "zsh" ? zsh_case : bash_case;
    auto cases = one_case(program, program, true);
    for (const auto& command : program.commands) cases += one_case(program, command, false);
    return filled(filled(shell == "zsh" ? zsh_script : bash_script, "@VALUES@", joined(values, shell == "zsh" ? "|" : " | ")), "@CASES@", cases);
}

} // namespace ise::cli
