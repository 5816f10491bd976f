#include "top_view.hpp"

#include "short_names.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kept_values = 240; // of a sparkline
constexpr std::size_t spark_columns = 10;
constexpr std::size_t least_names = 22; // columns, below which other columns leave
constexpr duration slow = 100ms, very_slow = 1s;
constexpr std::uint64_t much_unsent = 100'000, very_much_unsent = 1'000'000;

void remember(std::deque<double>& in, double value) {
    in.push_back(value);
    if (in.size() > kept_values) in.pop_front();
}

std::string rate_text(double hz) { return hz < 99.95 ? fmt::format("{:.1f}", hz) : fmt::format("{:.0f}", hz); }

// In 8 columns, "/s" apart.
std::string short_bytes(std::uint64_t count) {
    auto text = show_bytes(count);
    std::erase(text, ' ');
    return text;
}

// In 7 columns.
std::string short_duration(duration length) {
    auto text = show_duration(length);
    if (columns(text) > 7) std::erase(text, ' ');
    return text;
}

style of_duration(duration length) {
    return length >= very_slow ? style::bad : length >= slow ? style::warning : style::plain;
}
style of_bytes(std::uint64_t unsent) {
    return unsent >= very_much_unsent ? style::bad : unsent >= much_unsent ? style::warning : style::plain;
}
style of_rate(double hz) { return hz > 0 ? style::plain : style::dim; }
style of_state(const std::string& state, bool answered) {
    if (!answered || state == "stalled" || state == "failed") return style::bad;
    return state == "ready" ? style::good : style::warning;
}

std::string lower(std::string text) {
    for (auto& letter : text)
        if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
    return text;
}

std::string padded(const std::string& text, std::size_t width, bool right) {
    auto shown = cut(text, width);
    std::string space(width - std::min(width, columns(shown)), ' ');
    return right ? space + shown : shown + space;
}

// `left` from the left, `right` from the right where there is room for it.
styled_line both_ends(styled_line left, const styled_line& right, std::size_t width) {
    left = fitted(std::move(left), width);
    auto used = columns(left.text()), more = columns(right.text());
    if (used + 2 + more > width) return left;
    left.add(std::string(width - used - more, ' '));
    left.parts.insert(left.parts.end(), right.parts.begin(), right.parts.end());
    return left;
}

// The losses of a component or service: those of the last interval are news.
style of_losses(std::uint64_t ever, std::uint64_t now) {
    return now > 0 ? style::bad : ever > 0 ? style::warning : style::dim;
}
std::string loss_text(std::uint64_t ever, std::uint64_t now) {
    return now > 0 ? fmt::format("{}+{}", ever - now, now) : std::to_string(ever);
}

std::string reasons_of(const service_activity& of) {
    std::string text;
    for (const auto& [reason, count] : of.losses)
        text += fmt::format("{}{} {}", text.empty() ? "" : ", ", loss_text(count.ever, count.now), reason);
    return text;
}

styled_line section(const std::string& title) {
    styled_line made;
    made.add(title, style::heading);
    return made;
}

styled_line plain_line(std::string text, style how = style::plain) {
    styled_line made;
    made.add(printable(text), how);
    return made;
}

struct help_entry {
    const char *keys, *what;
};
constexpr help_entry help_text[] = {
    {"↑ ↓ PgUp PgDn Home End", "select a row"},
    {"Enter", "details: errors, services, queues, needs, peers"},
    {"Esc", "back; in a table: all rows again"},
    {"Tab, 1 2 3", "components, services, connections"},
    {"← →, s", "sort by another column"},
    {"r", "reverse the order"},
    {"/", "rows that contain a text (Enter keeps, Esc drops it)"},
    {"Space", "pause"},
    {"Ctrl-L, Ctrl-Z", "draw anew, suspend"},
    {"q, Ctrl-C", "end; q goes back from details"},
    {"", ""},
    {"RTT of a component", "of the question just asked, as in `ise ping`"},
    {"RTT of a connection", "of the last ping between both; 4 heartbeats old at most"},
    {"LOST", "packets slow subscribers did not take, refused calls"},
    {"LOST 12+3", "12 before, 3 in the last interval"},
    {"ACTIVITY", "calls and packets a second, by the row's own maximum"},
    {"P50 P99 WAIT99", "of handlers, of calls that wait for one"},
    {"yellow", "RTT, P99 from 100 ms; UNSENT from 100 kB; losses"},
    {"", "before; waiting; not ready"},
    {"red", "RTT, P99 from 1 s; UNSENT from 1 MB; losses now;"},
    {"", "stalled, silent, missing"},
};

} // namespace

std::string sparkline(const std::deque<double>& values, std::size_t width) {
    static constexpr const char* bars[] = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
    auto count = std::min(values.size(), width);
    std::string text(width - count, ' ');
    auto from = values.end() - static_cast<std::ptrdiff_t>(count);
    double most = 0;
    for (auto one = from; one != values.end(); ++one)
        if (std::isfinite(*one)) most = std::max(most, *one);
    for (auto one = from; one != values.end(); ++one) {
        if (!std::isfinite(*one)) {
            text += ' ';
            continue;
        }
        auto level = most > 0 ? std::ceil(*one / most * 7) : 0;
        text += bars[static_cast<std::size_t>(std::clamp(level, 0.0, 7.0))];
    }
    return text;
}

top_view::top_view(std::string where) : where_(std::move(where)) {
    // Those at work first, and the slowest.
    constexpr std::size_t by_rate = 3, by_round_trip = 3;
    tables_[static_cast<std::size_t>(table_kind::services)].sort = by_rate;
    tables_[static_cast<std::size_t>(table_kind::connections)].sort = by_round_trip;
}

void top_view::take(std::vector<surveyed> now, wall_time at) {
    before_ = std::move(now_);
    now_ = std::move(now);
    at_ = at;
    trouble_.clear();
    activities_ = activities(before_, now_);
    connections_ = connections_of(now_);
    double calls = 0, packets = 0;
    bool known = false;
    std::map<std::string, history> kept;
    for (std::size_t i = 0; i < activities_.size(); ++i) {
        const auto& one = activities_[i];
        auto& of = kept[one.path] = std::move(histories_[one.path]);
        if (!before_.empty()) {
            auto work = one.calls_hz ? *one.calls_hz + one.packets_hz.value_or(0) : std::nan("");
            remember(of.work, work);
            known = known || one.calls_hz.has_value();
        }
        if (one.answered) remember(of.answer_s, std::chrono::duration<double>(now_[i].answered_after).count());
        else remember(of.answer_s, std::nan(""));
        calls += one.calls_hz.value_or(0);
        packets += one.packets_hz.value_or(0);
    }
    histories_ = std::move(kept);
    if (!known) return;
    remember(calls_, calls);
    remember(packets_, packets);
}

const std::vector<top_view::column>& top_view::columns_of(table_kind of) const {
    static const std::vector<column> components{
        {"COMPONENT"},          {"STATE", 8},          {"CALLS/S", 7, 0, true}, {"PKT/S", 7, 0, true},
        {"IN/S", 7, 4, true},   {"OUT/S", 7, 3, true}, {"RTT", 7, 0, true},     {"RUN", 4, 6, true},
        {"UNSENT", 7, 5, true}, {"LOST", 7, 1, true},  {"PEERS", 5, 7, true},   {"ACTIVITY", spark_columns, 2},
        {"HOST", 14, 8},
    };
    static const std::vector<column> services{
        {"SERVICE"},          {"COMPONENT"},          {"KIND", 5, 5},      {"RATE/S", 7, 0, true}, {"P50", 7, 4, true},
        {"P99", 7, 0, true},  {"WAIT99", 7, 6, true}, {"RUN", 4, 3, true}, {"QUEUED", 6, 1, true}, {"SUBS", 4, 7, true},
        {"LOST", 7, 2, true},
    };
    static const std::vector<column> connections{
        {"FROM"},
        {"TO"},
        {"OVER", 6},
        {"RTT", 7, 0, true},
        {"THERE", 8, 1, true},
        {"BACK", 8, 2, true},
        {"SERVICES", 28, 3},
    };
    return of == table_kind::components ? components : of == table_kind::services ? services : connections;
}

top_view::row top_view::component_row(const activity& of) const {
    row made{of.path, of.path, {}};
    auto put = [&](std::string text, style how = style::plain, double order = 0) {
        made.cells.push_back({printable(text), how, order});
    };
    auto put_rate = [&](const std::optional<double>& hz) {
        if (hz) put(rate_text(*hz), of_rate(*hz), *hz);
        else put("-", style::dim, -1);
    };
    auto put_bytes = [&](const std::optional<double>& rate) {
        if (rate) put(short_bytes(static_cast<std::uint64_t>(*rate)), of_rate(*rate), *rate);
        else put("-", style::dim, -1);
    };
    const auto* asked = last_of(of.path);
    put(of.path);
    put(of.answered || of.state == "stalled" ? of.state : "silent", of_state(of.state, of.answered));
    put_rate(of.calls_hz);
    put_rate(of.packets_hz);
    put_bytes(of.in_bytes_per_s);
    put_bytes(of.out_bytes_per_s);
    if (of.answered && asked)
        put(short_duration(asked->answered_after), of_duration(asked->answered_after),
            std::chrono::duration<double>(asked->answered_after).count());
    else put("-", style::dim, -1);
    if (of.running) put(std::to_string(*of.running), of_rate(double(*of.running)), double(*of.running));
    else put("-", style::dim, -1);
    if (of.unsent_bytes)
        put(short_bytes(*of.unsent_bytes), *of.unsent_bytes == 0 ? style::dim : of_bytes(*of.unsent_bytes),
            double(*of.unsent_bytes));
    else put("-", style::dim, -1);
    auto lost = of.dropped_too_slow + of.calls_refused.value_or(0);
    auto lost_now = of.dropped_too_slow_now.value_or(0) + of.calls_refused_now.value_or(0);
    if (of.answered) put(loss_text(lost, lost_now), of_losses(lost, lost_now), double(lost_now) * 1e9 + double(lost));
    else put("-", style::dim, -1);
    if (of.answered) put(std::to_string(of.sessions), style::plain, double(of.sessions));
    else put("-", style::dim, -1);
    auto past = histories_.find(of.path);
    put(past == histories_.end() ? "" : sparkline(past->second.work, spark_columns), style::accent);
    put(of.host);
    return made;
}

std::vector<top_view::row> top_view::service_rows() const {
    std::vector<row> rows;
    for (const auto& of : activities_)
        for (const auto& one : of.services) {
            row made{fmt::format("{} {}", of.path, one.name), of.path, {}};
            auto put = [&](std::string text, style how = style::plain, double order = 0) {
                made.cells.push_back({printable(text), how, order});
            };
            auto put_time = [&](const std::optional<duration>& length) {
                if (length)
                    put(short_duration(*length), of_duration(*length), std::chrono::duration<double>(*length).count());
                else put("-", style::dim, -1);
            };
            put(one.name);
            put(of.path);
            put(one.publishes ? "topic" : "calls", style::dim);
            put(rate_text(one.hz), of_rate(one.hz), one.hz);
            put_time(one.handled_p50);
            put_time(one.handled_p99);
            put_time(one.waited_p99);
            if (one.publishes) put("-", style::dim, -1);
            else put(std::to_string(one.running), of_rate(double(one.running)), double(one.running));
            put(std::to_string(one.waiting), one.waiting > 0 ? style::warning : style::dim, double(one.waiting));
            if (one.publishes) put(std::to_string(one.subscribers), style::plain, double(one.subscribers));
            else put("-", style::dim, -1);
            std::uint64_t ever = 0, meanwhile = 0;
            for (const auto& [reason, count] : one.losses) {
                ever += count.ever;
                meanwhile += count.now;
            }
            put(loss_text(ever, meanwhile), of_losses(ever, meanwhile), double(meanwhile) * 1e9 + double(ever));
            rows.push_back(std::move(made));
        }
    return rows;
}

std::vector<top_view::row> top_view::connection_rows() const {
    std::vector<row> rows;
    for (const auto& one : connections_) {
        auto other = one.b.empty() ? one.address : one.b;
        row made{fmt::format("{} {}", one.a, other), one.a, {}};
        auto put = [&](std::string text, style how = style::plain, double order = 0) {
            made.cells.push_back({printable(text), how, order});
        };
        put(one.a);
        put(other, one.b.empty() ? style::dim : style::plain);
        put(one.stalled ? "stalled" : one.over, one.stalled ? style::bad : style::plain);
        if (one.round_trip > duration{})
            put(short_duration(one.round_trip), of_duration(one.round_trip),
                std::chrono::duration<double>(one.round_trip).count());
        else put("-", style::dim, -1);
        put(short_bytes(one.bytes_to_b), style::plain, double(one.bytes_to_b));
        put(short_bytes(one.bytes_to_a), style::plain, double(one.bytes_to_a));
        std::string names;
        for (const auto& service : one.services) names += (names.empty() ? "" : " ") + service.service;
        put(names, style::dim);
        rows.push_back(std::move(made));
    }
    return rows;
}

std::vector<top_view::row> top_view::rows_of(table_kind of) const {
    if (of == table_kind::services) return service_rows();
    if (of == table_kind::connections) return connection_rows();
    std::vector<row> rows;
    for (const auto& one : activities_) rows.push_back(component_row(one));
    return rows;
}

std::vector<top_view::row> top_view::visible_rows(table_kind of) const {
    auto rows = rows_of(of);
    if (auto wanted = lower(filter_); !wanted.empty())
        std::erase_if(rows, [&](const row& one) {
            return std::ranges::none_of(
                one.cells, [&](const cell& part) { return lower(part.text).find(wanted) != std::string::npos; });
        });
    const auto& by = tables_[static_cast<std::size_t>(of)];
    bool number = columns_of(of)[by.sort].number;
    std::ranges::stable_sort(rows, [&](const row& a, const row& b) {
        const auto &x = by.reversed ? b.cells[by.sort] : a.cells[by.sort],
                   &y = by.reversed ? a.cells[by.sort] : b.cells[by.sort];
        return number ? x.order > y.order : x.text < y.text;
    });
    return rows;
}

std::size_t top_view::selected_at(const std::vector<row>& rows) const {
    auto found = std::ranges::find(rows, state().selected, &row::id);
    return found == rows.end() ? 0 : static_cast<std::size_t>(found - rows.begin());
}

const surveyed* top_view::last_of(const std::string& path) const {
    auto found = std::ranges::find(now_, path, [](const surveyed& one) { return one.name.path; });
    return found == now_.end() ? nullptr : &*found;
}

// --- keys -----------------------------------------------------------------------------------------------------------

void top_view::press(const key_press& key) {
    if (key.what == key_press::kind::resized) return;
    if (filtering_) return press_in_filter(key);
    if (help_) {
        help_ = false;
        return;
    }
    if (key.what == key_press::kind::text && key.typed == "?") {
        help_ = true;
        return;
    }
    if (details_of_) return press_in_details(key);
    press_in_table(key);
}

void top_view::press_in_filter(const key_press& key) {
    using enum key_press::kind;
    if (key.what == text) {
        filter_ += key.typed;
    } else if (key.what == backspace) {
        while (!filter_.empty() && (static_cast<unsigned char>(filter_.back()) & 0xC0) == 0x80) filter_.pop_back();
        if (!filter_.empty()) filter_.pop_back();
    } else if (key.what == escape) {
        filter_ = filter_before_;
        filtering_ = false;
    } else if (key.what == up || key.what == down) {
        move(key.what == up ? -1 : 1);
    } else if (key.what == enter) {
        filtering_ = false;
    }
}

void top_view::press_in_details(const key_press& key) {
    using enum key_press::kind;
    auto last = details_lines_ > room_ ? details_lines_ - room_ : 0;
    switch (key.what) {
        case up: details_top_ -= std::min<std::size_t>(details_top_, 1); break;
        case down: details_top_ = std::min(details_top_ + 1, last); break;
        case page_up: details_top_ -= std::min(details_top_, room_); break;
        case page_down: details_top_ = std::min(details_top_ + room_, last); break;
        case home: details_top_ = 0; break;
        case end: details_top_ = last; break;
        case escape:
        case enter:
        case left:
        case backspace: details_of_.reset(); break;
        case text:
            if (key.typed == "q") details_of_.reset();
            if (key.typed == " ") paused_ = !paused_;
            break;
        default: break;
    }
}

void top_view::press_in_table(const key_press& key) {
    using enum key_press::kind;
    auto page = static_cast<std::ptrdiff_t>(std::max<std::size_t>(room_, 1));
    constexpr std::ptrdiff_t all = 1'000'000'000;
    switch (key.what) {
        case up: return move(-1);
        case down: return move(1);
        case page_up: return move(-page);
        case page_down: return move(page);
        case home: return move(-all);
        case end: return move(all);
        case left: return next_sort(-1);
        case right: return next_sort(1);
        case tab: shown_ = static_cast<table_kind>((static_cast<int>(shown_) + 1) % 3); return;
        case back_tab: shown_ = static_cast<table_kind>((static_cast<int>(shown_) + 2) % 3); return;
        case escape: filter_.clear(); return;
        case enter: {
            auto rows = visible_rows(shown_);
            if (rows.empty()) return;
            details_of_ = rows[selected_at(rows)].component;
            details_top_ = 0;
            return;
        }
        case text: return press_letter(key.typed);
        default: return;
    }
}

void top_view::press_letter(const std::string& typed) {
    if (typed == "q" || typed == "Q") ended_ = true;
    else if (typed == "/") filtering_ = true, filter_before_ = filter_;
    else if (typed == "s" || typed == ">") next_sort(1);
    else if (typed == "S" || typed == "<") next_sort(-1);
    else if (typed == "r") state().reversed = !state().reversed;
    else if (typed == " ") paused_ = !paused_;
    else if (typed == "j") move(1);
    else if (typed == "k") move(-1);
    else if (typed == "1") shown_ = table_kind::components;
    else if (typed == "2") shown_ = table_kind::services;
    else if (typed == "3") shown_ = table_kind::connections;
}

void top_view::move(std::ptrdiff_t by) {
    auto rows = visible_rows(shown_);
    if (rows.empty()) return;
    auto at = static_cast<std::ptrdiff_t>(selected_at(rows)) + by;
    at = std::clamp<std::ptrdiff_t>(at, 0, static_cast<std::ptrdiff_t>(rows.size()) - 1);
    state().selected = rows[static_cast<std::size_t>(at)].id;
}

void top_view::next_sort(std::ptrdiff_t by) {
    auto count = static_cast<std::ptrdiff_t>(columns_of(shown_).size());
    auto next = (static_cast<std::ptrdiff_t>(state().sort) + by + count) % count;
    state().sort = static_cast<std::size_t>(next);
    state().reversed = false;
}

// --- pages ----------------------------------------------------------------------------------------------------------

styled_line top_view::heading(std::size_t width) const {
    auto silent = std::ranges::count_if(activities_, [](const activity& one) { return !one.answered; });
    styled_line left, right;
    left.add("ise top", style::heading);
    left.add(fmt::format("  {} component{}", activities_.size(), activities_.size() == 1 ? "" : "s"));
    if (silent > 0) {
        left.add(", ");
        left.add(fmt::format("{} silent", silent), style::bad);
    }
    if (paused_) {
        left.add("  ");
        left.add("paused", style::warning);
    }
    if (!trouble_.empty()) {
        left.add("  ");
        left.add(fmt::format("old: {}", printable(trouble_)), style::bad);
    }
    right.add(fmt::format("{}  ", printable(where_)), style::dim);
    right.add(iso_8601(at_).substr(11), trouble_.empty() ? style::plain : style::bad);
    auto line = both_ends(left, right, width);
    if (line.parts.size() > left.parts.size()) return line;
    styled_line time;
    time.add(iso_8601(at_).substr(11), style::dim);
    return both_ends(std::move(left), time, width);
}

styled_line top_view::totals(std::size_t width) const {
    constexpr std::size_t spark = 16;
    styled_line line;
    auto put = [&](const char* what, const std::deque<double>& of) {
        line.add(what, style::dim);
        line.add(fmt::format("{:>8} ", of.empty() ? "-" : rate_text(of.back())));
        line.add(sparkline(of, spark), style::accent);
        line.add("  ");
    };
    put("calls/s", calls_);
    put("packets/s", packets_);
    return fitted(std::move(line), width);
}

styled_line top_view::tabs(std::size_t width) const {
    static constexpr const char* names[] = {"1 components", "2 services", "3 connections"};
    styled_line line;
    for (std::size_t at = 0; at < std::size(names); ++at) {
        bool here = at == static_cast<std::size_t>(shown_);
        line.add(fmt::format("{}{}{}", here ? "[" : " ", names[at], here ? "]" : " "),
                 here ? style::heading : style::dim);
        line.add(" ");
    }
    if (!filter_.empty() && !filtering_) line.add(fmt::format("  /{}  (Esc: all)", filter_), style::warning);
    return fitted(std::move(line), width);
}

styled_line top_view::keys(std::size_t width) const {
    styled_line line;
    if (filtering_) {
        line.add("/", style::accent);
        line.add(filter_ + "_");
        line.add("  Enter keeps, Esc drops it", style::dim);
        return fitted(std::move(line), width);
    }
    auto put = [&](const char* key, const char* what) {
        if (!line.parts.empty()) line.add("  ");
        line.add(key, style::accent);
        line.add(fmt::format(" {}", what), style::dim);
    };
    if (details_of_) {
        put("↑↓", "scroll");
        put("Esc", "back");
    } else {
        put("↑↓", "select");
        put("Enter", "details");
        put("/", "filter");
        put("←→", "sort");
        put("r", "reverse");
        put("Tab", "next");
    }
    put("?", "help");
    put("q", details_of_ ? "back" : "quit");
    return fitted(std::move(line), width);
}

styled_page top_view::page(std::size_t width, std::size_t height) {
    width = std::max<std::size_t>(width, 1);
    height = std::max<std::size_t>(height, 1);
    styled_page made;
    if (help_) {
        made.push_back(fitted(section("Keys and columns of ise top"), width));
        for (const auto& [keys, what] : help_text) {
            styled_line line;
            line.add(padded(keys, 24, false), style::accent);
            line.add(what);
            made.push_back(fitted(std::move(line), width));
        }
        made.push_back(fitted(plain_line("any key goes back", style::dim), width));
    } else if (details_of_) {
        made = details_page(width, height);
    } else {
        made = table_page(width, height);
    }
    if (made.size() > height) made.resize(height);
    return made;
}

styled_page top_view::table_page(std::size_t width, std::size_t height) {
    constexpr std::size_t gap = 1;
    const auto& heads = columns_of(shown_);
    auto rows = visible_rows(shown_);
    auto all = rows_of(shown_); // names are short among all, so that a filter does not change them
    std::vector<std::size_t> widths(heads.size());
    std::vector<bool> visible(heads.size(), true);
    std::size_t name_columns = 0;
    std::vector<std::size_t> longest(heads.size(), 4);
    for (std::size_t at = 0; at < heads.size(); ++at) {
        widths[at] = heads[at].width;
        if (heads[at].width != 0) continue;
        ++name_columns;
        longest[at] = columns(heads[at].heading) + 1;
        for (const auto& one : all) longest[at] = std::max(longest[at], columns(one.cells[at].text));
    }
    auto fixed = [&] {
        std::size_t sum = 0;
        for (std::size_t at = 0; at < heads.size(); ++at)
            if (visible[at] && heads[at].width != 0) sum += widths[at] + gap;
        return sum;
    };
    std::size_t names_wanted = 0;
    for (std::size_t at = 0; at < heads.size(); ++at)
        if (heads[at].width == 0) names_wanted += std::min(longest[at], least_names) + gap;
    while (fixed() + names_wanted > width) {
        std::size_t leaves = heads.size();
        for (std::size_t at = 0; at < heads.size(); ++at)
            if (visible[at] && heads[at].leaves > 0 &&
                (leaves == heads.size() || heads[at].leaves > heads[leaves].leaves))
                leaves = at;
        if (leaves == heads.size()) break;
        visible[leaves] = false;
    }
    // The names share what is left; one that needs less leaves it to the next.
    auto left = width > fixed() ? width - fixed() : 0;
    for (std::size_t at = 0, names = name_columns; at < heads.size(); ++at) {
        if (heads[at].width != 0) continue;
        auto share = left / names;
        widths[at] = std::min(longest[at], share > gap ? share - gap : 1);
        left -= std::min(left, widths[at] + gap);
        --names;
    }
    std::vector<std::map<std::string, std::string>> shortened(heads.size());
    for (std::size_t at = 0; at < heads.size(); ++at) {
        if (heads[at].width != 0) continue;
        std::vector<std::string> names;
        for (const auto& one : all) names.push_back(one.cells[at].text);
        auto made = short_names(names, widths[at]);
        for (std::size_t which = 0; which < names.size(); ++which) shortened[at][names[which]] = made[which];
    }

    styled_page made;
    made.push_back(heading(width));
    made.push_back(totals(width));
    made.push_back(tabs(width));
    styled_line headings;
    for (std::size_t at = 0; at < heads.size(); ++at) {
        if (!visible[at]) continue;
        auto text = heads[at].heading;
        bool sorted = at == state().sort;
        if (sorted) text += heads[at].number == state().reversed ? "▲" : "▼";
        // The arrow may stand in the gap.
        auto wide = std::max(widths[at], std::min(columns(text), widths[at] + gap));
        headings.add(padded(text, wide, heads[at].number) + std::string(widths[at] + gap - wide, ' '),
                     sorted ? style::heading : style::dim);
    }
    made.push_back(fitted(std::move(headings), width));
    room_ = height > made.size() + 1 ? height - made.size() - 1 : 0;

    auto selected = selected_at(rows);
    auto& top = state().top;
    top = std::min(top, rows.size() - std::min(rows.size(), room_));
    if (selected < top) top = selected;
    if (room_ > 0 && selected >= top + room_) top = selected - room_ + 1;
    for (std::size_t which = top; which < std::min(rows.size(), top + room_); ++which) {
        styled_line line;
        line.selected = which == selected;
        for (std::size_t at = 0; at < heads.size(); ++at) {
            if (!visible[at]) continue;
            const auto& one = rows[which].cells[at];
            const auto& text = heads[at].width == 0 ? shortened[at].at(one.text) : one.text;
            line.add(padded(text, widths[at], heads[at].number), one.how);
            line.add(std::string(gap, ' '));
        }
        made.push_back(fitted(std::move(line), width));
    }
    if (rows.empty() && room_ > 0)
        made.push_back(
            fitted(plain_line(!filter_.empty()                   ? fmt::format("no row contains '{}'", filter_)
                              : shown_ == table_kind::components ? std::string("no components are registered")
                              : before_.empty()                  ? std::string("measuring…")
                              : shown_ == table_kind::services   ? std::string("no services are provided")
                                                                 : std::string("no connections"),
                              style::dim),
                   width));
    made.resize(std::max(made.size(), height - 1));
    made.push_back(keys(width));
    styled_line place;
    if (rows.size() > room_ && room_ > 0)
        place.add(fmt::format("{}-{} of {}", top + 1, top + room_, rows.size()), style::dim);
    if (height > 4) made[2] = both_ends(std::move(made[2]), place, width);
    return made;
}

styled_page top_view::details_page(std::size_t width, std::size_t height) {
    auto all = details(width);
    details_lines_ = all.size();
    styled_page made;
    made.push_back(heading(width));
    room_ = height > 2 ? height - 2 : 0;
    details_top_ = std::min(details_top_, details_lines_ > room_ ? details_lines_ - room_ : 0);
    for (auto at = details_top_; at < std::min(all.size(), details_top_ + room_); ++at)
        made.push_back(fitted(std::move(all[at]), width));
    made.resize(std::max(made.size(), height - 1));
    styled_line place;
    if (all.size() > room_)
        place.add(
            fmt::format("lines {}-{} of {}", details_top_ + 1, std::min(all.size(), details_top_ + room_), all.size()),
            style::dim);
    made.push_back(both_ends(keys(width), place, width));
    return made;
}

std::string top_view::providers_of(const std::string& service) const {
    std::string text;
    for (const auto& one : now_) {
        if (!one.about) continue;
        for (const auto& other : one.about->services)
            if (other.provided && other.name == service) text += (text.empty() ? "" : ", ") + one.name.path;
    }
    return text;
}

std::vector<styled_line> top_view::details(std::size_t width) const {
    std::vector<styled_line> made;
    const auto* of = last_of(*details_of_);
    auto found = std::ranges::find(activities_, *details_of_, &activity::path);
    if (!of || found == activities_.end()) {
        made.push_back(plain_line(fmt::format("{} is not registered any more", *details_of_), style::bad));
        return made;
    }
    styled_line title;
    title.add(printable(of->name.path), style::heading);
    title.add("  ");
    title.add(found->answered || found->state == "stalled" ? printable(found->state) : "silent",
              of_state(found->state, found->answered));
    title.add(printable(fmt::format("  {}  process {}{}", of->name.host_name, of->name.process_id,
                                    of->name.type.empty() ? "" : "  " + of->name.type)));
    made.push_back(std::move(title));
    styled_line where;
    where.add("listens at ", style::dim);
    std::string endpoints;
    for (const auto& one : reachable_first(of->name.endpoints)) endpoints += (endpoints.empty() ? "" : " ") + one;
    where.add(endpoints.empty() ? "nothing" : printable(endpoints));
    made.push_back(std::move(where));
    if (!of->name.roles.empty()) {
        styled_line roles;
        roles.add("serves ", style::dim);
        for (const auto& [role, priority] : of->name.roles)
            roles.add(printable(fmt::format("{} ({})  ", role, priority)));
        made.push_back(std::move(roles));
    }
    const auto& past = histories_.at(of->name.path);
    constexpr std::size_t spark = 32;
    auto chart = [&](const char* what, std::string value, const std::deque<double>& values, style how) {
        styled_line line;
        line.add(padded(what, 11, false), style::dim);
        line.add(padded(value, 10, true) + "  ", how);
        line.add(sparkline(values, spark), style::accent);
        made.push_back(std::move(line));
    };
    auto work =
        past.work.empty() || !std::isfinite(past.work.back()) ? std::string("-") : rate_text(past.work.back()) + "/s";
    chart("work", work, past.work, style::plain);
    chart("round trip", found->answered ? show_duration(of->answered_after) : "-", past.answer_s,
          found->answered ? of_duration(of->answered_after) : style::dim);
    made.emplace_back();
    add_troubles(made, *of, *found);
    add_services(made, *of, *found);
    add_peers(made, *of, width);
    return made;
}

void top_view::add_services(std::vector<styled_line>& to, const surveyed& of, const activity& meanwhile) const {
    if (!of.about) return;
    to.push_back(section(fmt::format("{:<24} {:>8} {:>8} {:>8} {:>4} {:>6} {:>5}", "PROVIDES", "RATE/S", "P50", "P99",
                                     "RUN", "QUEUED", "SUBS")));
    std::size_t count = 0;
    for (const auto& one : of.about->services) {
        if (!one.provided || is_own_service(one.name)) continue;
        ++count;
        styled_line line;
        line.add(padded("  " + printable(one.name), 24, false));
        auto work = std::ranges::find(meanwhile.services, one.name, &service_activity::name);
        if (work == meanwhile.services.end()) {
            line.add("        -", style::dim);
        } else {
            auto time = [&](const std::optional<duration>& length) {
                line.add(" " + padded(length ? show_duration(*length) : "-", 8, true),
                         length ? of_duration(*length) : style::dim);
            };
            line.add(" " + padded(rate_text(work->hz), 8, true), of_rate(work->hz));
            time(work->handled_p50);
            time(work->handled_p99);
            line.add(" " + padded(work->publishes ? "-" : std::to_string(work->running), 4, true),
                     of_rate(double(work->running)));
            line.add(" " + padded(std::to_string(work->waiting), 6, true),
                     work->waiting > 0 ? style::warning : style::dim);
            line.add(" " + padded(work->publishes ? std::to_string(work->subscribers) : "-", 5, true),
                     work->publishes ? style::plain : style::dim);
            if (auto why = reasons_of(*work); !why.empty())
                line.add("  " + printable(why), work->loses() ? style::bad : style::warning);
        }
        to.push_back(std::move(line));
    }
    if (count == 0) to.push_back(plain_line("  nothing", style::dim));
    to.emplace_back();
    to.push_back(section("NEEDS"));
    std::set<std::string> needed;
    for (const auto& one : of.about->services)
        if (!one.provided && !is_own_service(one.name)) needed.insert(one.name);
    for (const auto& name : needed) {
        styled_line line;
        auto from = providers_of(name);
        line.add(padded("  " + printable(name), 24, false));
        if (from.empty()) line.add(" missing: no component provides it", style::bad);
        else line.add(" from " + printable(from), style::dim);
        to.push_back(std::move(line));
    }
    if (needed.empty()) to.push_back(plain_line("  nothing", style::dim));
    to.emplace_back();
}

void top_view::add_peers(std::vector<styled_line>& to, const surveyed& of, std::size_t width) const {
    if (!of.about) return;
    auto then = std::ranges::find_if(
        before_, [&](const surveyed& one) { return one.about && one.about->incarnation == of.about->incarnation; });
    std::vector<std::string> names;
    std::size_t longest = 10;
    for (const auto& one : of.about->sessions) {
        auto peer = peer_of(one.peer);
        names.push_back(printable(peer.path.empty() ? peer.address : peer.path));
        if (!peer.looks_only()) longest = std::max(longest, columns(names.back()));
    }
    constexpr std::size_t figures = 48; // columns
    longest = std::min(longest, width > figures + 12 ? width - figures : 12);
    auto shortened = short_names(names, longest);
    to.push_back(section(padded("PEERS", longest + 2, false) +
                         fmt::format(" {:<6} {:>8} {:>9} {:>9} {:>9}", "OVER", "RTT", "IN/S", "OUT/S", "UNSENT")));
    std::size_t count = 0;
    for (const auto& one : of.about->sessions) {
        auto peer = peer_of(one.peer);
        if (peer.looks_only()) continue;
        ++count;
        std::optional<double> in, out;
        if (then != before_.end()) {
            auto old = std::ranges::find(then->about->sessions, one.peer, &session_info::peer);
            auto seconds = std::chrono::duration<double>(of.answered_at - then->answered_at).count();
            if (old != then->about->sessions.end() && seconds > 0 && one.bytes_in >= old->bytes_in &&
                one.bytes_out >= old->bytes_out) {
                in = double(one.bytes_in - old->bytes_in) / seconds;
                out = double(one.bytes_out - old->bytes_out) / seconds;
            }
        }
        std::optional<std::uint64_t> unsent;
        if (of.health)
            for (const auto& load : of.health->sessions)
                if (load.peer == one.peer) unsent = load.unsent_bytes;
        auto bytes = [](const std::optional<double>& rate) {
            return padded(rate ? short_bytes(static_cast<std::uint64_t>(*rate)) : "-", 9, true);
        };
        styled_line line;
        line.add("  " + padded(shortened[static_cast<std::size_t>(&one - of.about->sessions.data())], longest, false));
        line.add(" " + padded(printable(peer.over()), 6, false));
        line.add(" " + padded(one.round_trip_ns > 0 ? show_duration(duration(one.round_trip_ns)) : "-", 8, true),
                 of_duration(duration(one.round_trip_ns)));
        line.add(fmt::format(" {} {}", bytes(in), bytes(out)));
        line.add(" " + padded(unsent ? short_bytes(*unsent) : "-", 9, true), of_bytes(unsent.value_or(0)));
        if (one.peer_stalled) line.add("  stalled", style::bad);
        to.push_back(std::move(line));
        std::string uses;
        for (const auto& name : one.uses)
            if (!is_own_service(name)) uses += (uses.empty() ? "" : ", ") + name;
        if (!uses.empty()) to.push_back(plain_line("    uses " + uses, style::dim));
    }
    if (count == 0) to.push_back(plain_line("  none", style::dim));
}

void top_view::add_troubles(std::vector<styled_line>& to, const surveyed& of, const activity& meanwhile) const {
    std::vector<styled_line> found;
    if (!of.trouble.empty()) found.push_back(plain_line("  does not answer: " + of.trouble, style::bad));
    if (of.about) {
        for (const auto& one : of.about->waits)
            found.push_back(plain_line(
                fmt::format("  waits for {}{} for {}{}", one.service.empty() ? "" : "'" + one.service + "' of ",
                            one.target, show_duration(one.waited), one.cause.empty() ? "" : ": " + one.cause),
                one.waited >= 3s ? style::bad : style::warning));
        for (const auto& one : of.about->ended_subscriptions)
            found.push_back(
                plain_line(fmt::format("  subscription to '{}' of {} ended: {}", one.service, one.provider, one.cause),
                           style::bad));
        if (meanwhile.dropped_too_slow > 0)
            found.push_back(plain_line(
                fmt::format("  {} packets not taken by slow subscribers",
                            loss_text(meanwhile.dropped_too_slow, meanwhile.dropped_too_slow_now.value_or(0))),
                of_losses(meanwhile.dropped_too_slow, meanwhile.dropped_too_slow_now.value_or(0))));
    }
    if (of.health && of.health->calls_refused > 0) {
        auto other = of.health->calls_refused -
                     std::min(of.health->calls_refused, of.health->calls_expired + of.health->calls_overloaded);
        found.push_back(
            plain_line(fmt::format("  calls refused: {} expired, {} beyond a limit, {} unknown or mismatched",
                                   of.health->calls_expired, of.health->calls_overloaded, other),
                       of_losses(of.health->calls_refused, meanwhile.calls_refused_now.value_or(0))));
    }
    if (found.empty()) return;
    to.push_back(section("ERRORS"));
    to.insert(to.end(), found.begin(), found.end());
    to.emplace_back();
}

} // namespace ise::cli
