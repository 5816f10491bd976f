#include <components/gprs/line_reader.hpp>

#include <fmt/format.h>

namespace atirma::gprs {

void line_reader::push(ise::bytes_view bytes) {
    buffer_.erase(0, taken_);
    taken_ = 0;
    buffer_.append(ise::as_text(bytes));
}

std::optional<ise::result<line>> line_reader::next() {
    auto too_long = [] {
        return ise::failure(ise::errc::too_large, fmt::format("a line of more than {} characters", max_line));
    };
    for (;;) {
        auto rest = std::string_view(buffer_).substr(taken_);
        auto end = rest.find('\n');
        if (end == std::string_view::npos) {
            if (rest.size() <= max_line + 1) return std::nullopt; // the CR may be there already
            taken_ = buffer_.size();
            if (std::exchange(skipping_, true)) return std::nullopt;
            return ise::result<line>(too_long());
        }
        taken_ += end + 1;
        if (std::exchange(skipping_, false)) continue; // the end of one that was told
        auto text = rest.substr(0, end);
        if (text.ends_with('\r')) text.remove_suffix(1);
        if (text.empty()) continue;
        return parse(text);
    }
}

} // namespace atirma::gprs
