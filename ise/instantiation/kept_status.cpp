#include <ise/instantiation/kept_status.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

namespace ise::instantiation {
namespace {

std::string one_line(std::string text) {
    constexpr std::size_t most = 240; // two of them fit into a record
    if (text.size() > most) text.resize(most);
    std::ranges::replace(text, '\n', ' ');
    return text;
}

} // namespace

std::string kept_status_text(const kept_status& of, std::uint64_t sequence, bool moving) {
    auto text =
        fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {}\n", sequence, moving ? 1 : 0, of.base, of.dropped, of.life,
                    of.mark.empty() ? "-" : of.mark, of.process.pid, of.process.start_ticks, of.ended ? 1 : 0,
                    of.how.known ? 1 : 0, of.how.by_signal ? 1 : 0, of.how.number, of.ended_at_ms);
    text += one_line(of.trouble) + "\n" + one_line(of.how.reason) + "\n";
    auto end = fmt::format("{}\n", sequence);
    text.resize(kept_status_bytes - end.size(), ' ');
    return text + end;
}

std::optional<kept_status> read_kept_status(std::string_view text) {
    if (text.size() != kept_status_bytes) return {};
    std::istringstream lines{std::string(text)};
    kept_status made;
    std::uint64_t sequence = 0, sequence_at_end = 0;
    int moving = 0, ended = 0, known = 0, by_signal = 0;
    lines >> sequence >> moving >> made.base >> made.dropped >> made.life >> made.mark >> made.process.pid >>
        made.process.start_ticks >> ended >> known >> by_signal >> made.how.number >> made.ended_at_ms;
    std::string rest;
    std::getline(lines, rest);
    std::getline(lines, made.trouble);
    std::getline(lines, made.how.reason);
    lines >> sequence_at_end;
    if (!lines || sequence != sequence_at_end || moving != 0) return {};
    if (made.mark == "-") made.mark.clear();
    made.ended = ended != 0;
    made.how.known = known != 0;
    made.how.by_signal = by_signal != 0;
    return made;
}

} // namespace ise::instantiation
