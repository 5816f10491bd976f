#include <ise/instantiation/output_file.hpp>

#include <algorithm>

namespace ise::instantiation {
namespace {

constexpr std::size_t piece_bytes = 256 << 10; // of one look
constexpr int trials = 5;

} // namespace

output_file::output_file(machine& host, std::string file, std::uint64_t max_bytes)
    : host_(host), file_(std::move(file)), max_bytes_(max_bytes) {
    seen_ = end();
}

std::optional<kept_status> output_file::status() const {
    auto text = host_.read_file(status_file_of(file_), 2 * kept_status_bytes);
    return text ? read_kept_status(*text) : std::nullopt;
}

std::uint64_t output_file::end() const {
    auto now = status();
    return (now ? now->base : 0) + host_.size_of(file_);
}

/// From that byte on, or from the first that is still there.
output_file::range output_file::read(std::uint64_t from, std::size_t most) const {
    range made;
    for (int trial = 0; trial < trials; ++trial) { // the file may be replaced meanwhile
        auto before = status();
        auto base = before ? before->base : 0;
        auto older = older_output_of(file_);
        auto older_size = host_.size_of(older);
        auto size = host_.size_of(file_);
        made.from = std::clamp(from, base - std::min(base, older_size), base + size);
        made.text.clear();
        if (made.from < base)
            made.text = host_.read_part(older, older_size - (base - made.from),
                                        static_cast<std::size_t>(std::min<std::uint64_t>(most, base - made.from)));
        auto at = made.from + made.text.size();
        if (at >= base && made.text.size() < most)
            made.text += host_.read_part(file_, at - base, most - made.text.size());
        auto after = status();
        if (before.has_value() == after.has_value() && (!after || after->base == base)) return made;
    }
    made.text.clear();
    return made;
}

output_piece output_file::look(bool wanted) {
    if (auto now = status()) {
        dropped_ = now->dropped;
        trouble_ = now->trouble;
    }
    output_piece piece;
    auto now = end();
    if (!wanted || now < seen_) {
        piece.offset = seen_ = now;
        return piece;
    }
    auto got = read(seen_, piece_bytes);
    piece.offset = got.from;
    piece.text = std::move(got.text);
    if (!piece.text.empty()) seen_ = piece.offset + piece.text.size();
    return piece;
}

output_piece output_file::last(std::size_t max_bytes) const {
    output_piece made;
    auto now = end();
    auto got = read(now - std::min<std::uint64_t>(now, max_bytes), max_bytes);
    made.offset = got.from;
    made.text = std::move(got.text);
    if (made.offset > 0) { // the first line may be a part of one
        auto end = made.text.find('\n');
        if (end != std::string::npos && end + 1 < made.text.size()) {
            made.text.erase(0, end + 1);
            made.offset += end + 1;
        }
    }
    return made;
}

std::string output_file::last_lines(std::size_t lines) const {
    auto text = last(4096).text;
    while (text.ends_with('\n')) text.pop_back();
    auto from = text.size();
    for (std::size_t line = 0; line < lines && from != std::string::npos; ++line)
        from = from == 0 ? std::string::npos : text.rfind('\n', from - 1);
    return from == std::string::npos ? text : text.substr(from + 1);
}

void output_file::remove() {
    host_.remove(file_);
    host_.remove(older_output_of(file_));
    host_.remove(status_file_of(file_));
    seen_ = dropped_ = 0;
    trouble_.clear();
}

} // namespace ise::instantiation
