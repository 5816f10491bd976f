#include <ise/instantiation/output_file.hpp>

#include <algorithm>

namespace ise::instantiation {
namespace {

constexpr std::size_t piece_bytes = 64 << 10;

} // namespace

output_file::output_file(machine& host, std::string file, std::uint64_t max_bytes) : host_(host), file_(std::move(file)), max_bytes_(max_bytes) {
    seen_ = host_.size_of(file_);
}

output_piece output_file::look(bool wanted) {
    output_piece piece;
    auto size = host_.size_of(file_);
    seen_ = std::min(seen_, size);
    if (wanted && size > seen_) {
        if (size - seen_ > max_bytes_) seen_ = size - max_bytes_; // it prints faster than anybody reads
        piece.offset = base_ + seen_;
        piece.text = host_.read_part(file_, seen_, size > max_bytes_ ? max_bytes_ : piece_bytes); // before it is moved away, all
        seen_ += piece.text.size();
    } else {
        piece.offset = base_ + size;
        seen_ = size;
    }
    if (size > max_bytes_) {
        auto moved = host_.rotate(file_, older());
        if (moved) {
            base_ += size;
            seen_ = 0;
        }
    }
    return piece;
}

output_piece output_file::last(std::size_t max_bytes) const {
    output_piece made;
    auto size = host_.size_of(file_);
    auto here = std::min<std::uint64_t>(size, max_bytes);
    made.text = host_.read_part(file_, size - here, here);
    made.offset = base_ + size - here;
    if (here < max_bytes) {
        auto before = host_.size_of(older());
        auto there = std::min<std::uint64_t>(before, max_bytes - here);
        if (there > 0) {
            made.text = host_.read_part(older(), before - there, there) + made.text;
            made.offset -= std::min(made.offset, there);
        }
    }
    if (made.text.size() == max_bytes) { // the first line may be a part of one
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
    for (std::size_t line = 0; line < lines && from != std::string::npos; ++line) from = from == 0 ? std::string::npos : text.rfind('\n', from - 1);
    return from == std::string::npos ? text : text.substr(from + 1);
}

void output_file::remove() {
    host_.remove(file_);
    host_.remove(older());
    host_.remove(end_file());
    base_ = seen_ = 0;
}

} // namespace ise::instantiation
