#include <components/xbee/decoder.hpp>

#include <components/xbee/framing.hpp>

#include <algorithm>

namespace atirma::xbee {

void frame_decoder::push(ise::bytes_view piece) {
    giving_up_ = false;
    if (begin_ > 0 && begin_ >= buffer_.size() / 2) {
        buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
        begin_ = 0;
    }
    buffer_.insert(buffer_.end(), piece.begin(), piece.end());
}

std::optional<parsed_frame> frame_decoder::next() {
    auto start = std::find(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_), buffer_.end(), std::byte{0x7E});
    auto garbage = static_cast<std::size_t>(start - buffer_.begin()) - begin_;
    skipped_ += garbage;
    drop(garbage);
    if (begin_ == buffer_.size()) return std::nullopt;

    frame_scan scan = scan_frame(ise::bytes_view(buffer_).subspan(begin_), mode_);
    if (scan.state == scan_state::incomplete) {
        if (!giving_up_) return std::nullopt;
        drop(1);
        return parsed_frame(refused{refusal::truncated, "the line fell silent in the middle of a frame"});
    }
    if (scan.state == scan_state::refused) {
        drop(1); // only the false delimiter: a true frame may start right behind it
        return parsed_frame(refused{scan.reason, std::move(scan.message)});
    }
    drop(scan.wire_size);
    return parse_frame_data(scan.data);
}

void frame_decoder::give_up() { giving_up_ = in_frame(); }

void frame_decoder::reset(api_mode mode) {
    buffer_.clear();
    begin_ = 0;
    giving_up_ = false;
    mode_ = mode;
}

void frame_decoder::drop(std::size_t count) {
    begin_ += count;
    if (begin_ == buffer_.size()) {
        buffer_.clear();
        begin_ = 0;
        giving_up_ = false;
    }
}

} // namespace atirma::xbee
