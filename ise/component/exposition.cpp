#include <ise/component/exposition.hpp>

#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>

namespace ise::detail {
namespace {

// Texts of peers: nothing of them ends a label or a line, and all is UTF-8.
std::string escaped(std::string_view text) {
    const bool utf8 = is_utf8(text);
    std::string made;
    for (char one : text) {
        if (one == '\\' || one == '"') made += '\\';
        if (one == '\n') made += "\\n";
        else if (!utf8 && (static_cast<unsigned char>(one) & 0x80)) made += '?';
        else made += one;
    }
    return made;
}

std::string text_of(exposition::labels of) {
    std::string made;
    for (const auto& [name, value] : of)
        made += fmt::format("{}{}=\"{}\"", made.empty() ? "" : ",", name, escaped(value));
    return made;
}

} // namespace

void exposition::family::line(std::string_view suffix, std::string_view labels, std::string_view value) {
    if (labels.empty()) text_ += fmt::format("{}{} {}\n", name_, suffix, value);
    else text_ += fmt::format("{}{}{{{}}} {}\n", name_, suffix, labels, value);
    empty_ = false;
    ++in_->series_;
}

void exposition::family::add(labels of, double value) { line("", text_of(of), fmt::format("{}", value)); }
void exposition::family::add(labels of, std::uint64_t value) { line("", text_of(of), fmt::format("{}", value)); }

void exposition::family::add_histogram(labels of, const std::vector<std::pair<double, std::uint64_t>>& bounds,
                                       std::uint64_t count, double sum) {
    const auto all = text_of(of);
    auto bucket = [&](std::string_view le, std::uint64_t below) {
        line("_bucket", fmt::format("{}{}le=\"{}\"", all, all.empty() ? "" : ",", le), fmt::format("{}", below));
    };
    for (const auto& [bound, below] : bounds) bucket(fmt::format("{}", bound), below);
    bucket("+Inf", count);
    line("_sum", all, fmt::format("{}", sum));
    line("_count", all, fmt::format("{}", count));
}

exposition::family& exposition::metric(std::string_view name, kind of, std::string_view help) {
    auto found = places_.find(name);
    if (found != places_.end()) return families_[found->second];
    auto title = name; // OpenMetrics names a counter without its suffix
    if (format_ == format::open_metrics && of == kind::counter) title = name.substr(0, name.rfind("_total"));
    static constexpr std::string_view kinds[] = {"counter", "gauge", "histogram"};
    auto head = fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n", title, help, kinds[static_cast<std::size_t>(of)]);
    places_.emplace(name, families_.size());
    families_.push_back(family(*this, std::string(name), std::move(head)));
    return families_.back();
}

std::string exposition::text() const {
    std::string made;
    for (const auto& one : families_)
        if (!one.empty_) made += one.text_;
    if (format_ == format::open_metrics) made += "# EOF\n";
    return made;
}

std::string_view exposition::content_type(format of) noexcept {
    return of == format::prometheus ? "text/plain; version=0.0.4; charset=utf-8"
                                    : "application/openmetrics-text; version=1.0.0; charset=utf-8";
}

} // namespace ise::detail
