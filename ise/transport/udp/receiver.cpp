#include <ise/transport/udp/receiver.hpp>

#include <ise/transport/udp/outgoing_messages.hpp>
#include <ise/wire/frame.hpp>

#include <array>
#include <cstring>

namespace ise::net::udp {
namespace {

// Gaps that are remembered; a network that makes more gets some things twice.
constexpr std::size_t max_gaps = 64;
// A gap that lies so far back is not told any more: what was lost there was sent again long ago.
constexpr std::uint64_t told_back = 256;
constexpr std::size_t max_stream_gaps = 256;
constexpr std::size_t max_finished = 256;
constexpr std::size_t runs_alone = 32, runs_beside = 6;

} // namespace

[[gnu::hot]] void receiver::note(std::uint64_t number, bool wants_ack, time_point now) {
    bool in_order = came_.empty() ? number == 0 : number == largest_ + 1;
    came_.add(number, number + 1);
    if (number >= largest_) {
        largest_ = number;
        largest_at_ = now;
    }
    while (came_.intervals() > max_gaps ||
           (came_.intervals() > 1 && came_.all().front().second + told_back < largest_)) {
        floor_ = came_.all().front().second;
        came_.drop_first();
    }
    if (!wants_ack) return;
    ++pending_acks_;
    // Every second one at once, and what shows a gap or comes late.
    ack_at_ = pending_acks_ >= 2 || !in_order ? time_point::min() : std::min(ack_at_, now + ack_delay);
}

void receiver::put_ack(wire::data_writer& out, bool alone, time_point now) {
    if (!came_.empty()) put_runs(out, alone, now);
    out.put(wire::chunk_type::room, room());
    told_room_ = room();
    room_grew_ = false;
    pending_acks_ = 0;
    ack_at_ = time_point::max();
}

[[gnu::hot]] void receiver::put_runs(wire::data_writer& out, bool alone, time_point now) const {
    std::array<std::byte, 16 + 8 * runs_alone> raw;
    auto limit = alone ? runs_alone : runs_beside;
    auto run = came_.all().rbegin();
    auto delay = std::chrono::duration_cast<std::chrono::microseconds>(now - largest_at_).count();
    detail::store_little(raw.data(), run->second - 1);
    detail::store_little(raw.data() + 8, static_cast<std::uint32_t>(std::min<std::int64_t>(delay, 0xffff'ffff)));
    auto length = [](std::uint64_t count) {
        return static_cast<std::uint32_t>(std::min<std::uint64_t>(count, 0xffff'ffff));
    };
    detail::store_little(raw.data() + 12, length(run->second - run->first));
    std::size_t size = 16;
    for (auto above = run++; run != came_.all().rend() && size < 16 + 8 * (limit - 1); above = run++) {
        auto gap = above->first - run->second;
        if (gap > 0xffff'ffff || above->second - above->first > 0xffff'ffff) break;
        detail::store_little(raw.data() + size, static_cast<std::uint32_t>(gap));
        detail::store_little(raw.data() + size + 4, length(run->second - run->first));
        size += 8;
    }
    out.put(wire::chunk_type::ack, bytes_view(raw).first(size));
}

[[gnu::hot]] bool receiver::take_content(std::uint64_t offset, bytes_view content) {
    if (content.empty()) return true;
    if (offset > room() || content.size() > room() - offset) return false;
    auto end = offset + content.size();
    if (end_ && end > *end_) return false;
    if (end <= upto_) return true; // known
    if (offset < base_) {
        content = content.subspan(static_cast<std::size_t>(base_ - offset));
        offset = base_;
    }
    if (offset > upto_ && got_.intervals() >= max_stream_gaps && got_.apart(offset, end)) return false;
    auto at = head_ + static_cast<std::size_t>(offset - base_);
    if (buffer_.size() < at + content.size()) buffer_.resize(at + content.size());
    std::memcpy(buffer_.data() + at, content.data(), content.size());
    if (offset > upto_) {
        got_.add(offset, end);
        return true;
    }
    upto_ = end;
    for (; !got_.empty() && got_.all().front().first <= upto_; got_.drop_first())
        upto_ = std::max(upto_, got_.all().front().second);
    return true;
}

bool receiver::take_end(std::uint64_t offset) {
    if (end_) return *end_ == offset;
    if (offset < upto_ || (!got_.empty() && got_.all().back().second > offset)) return false;
    end_ = offset;
    return true;
}

[[gnu::hot]] std::size_t receiver::read(std::span<std::byte> into) {
    auto content = ready();
    content = content.first(std::min(into.size(), content.size()));
    if (content.empty()) return 0;
    std::memcpy(into.data(), content.data(), content.size());
    consume(content.size());
    return content.size();
}

[[gnu::hot]] void receiver::consume(std::size_t count) {
    head_ += count;
    base_ += count;
    if (head_ == buffer_.size()) {
        buffer_.clear();
        head_ = 0;
    } else if (head_ > buffer_.size() / 2) {
        buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(head_));
        head_ = 0;
    }
    // Who reads much may be sent more at once.
    if (base_ > 2 * window_) window_ = std::min<std::uint64_t>(window_ * 2, max_window);
    if (room() - told_room_ >= window_ / 2) {
        room_grew_ = true;
        ack_at_ = time_point::min();
    }
}

void incoming_messages::drop(std::map<std::uint64_t, partial>::iterator which) {
    held_ -= which->second.came;
    all_.erase(which);
    ++dropped_;
}

void incoming_messages::drop_stale(time_point now) {
    for (auto at = all_.begin(); at != all_.end();) {
        auto next = std::next(at);
        if (now - at->second.last >= patience) drop(at);
        at = next;
    }
}

time_point incoming_messages::due() const noexcept {
    auto at = time_point::max();
    for (const auto& [number, one] : all_) at = std::min(at, saturating_add(one.last, patience));
    return at;
}

bool incoming_messages::take(bytes_view content, time_point now, std::optional<bytes>& done) {
    if (content.size() <= 16) return false;
    auto number = detail::load_little<std::uint64_t>(content.data());
    auto size = detail::load_little<std::uint32_t>(content.data() + 8);
    auto index = detail::load_little<std::uint32_t>(content.data() + 12);
    content = content.subspan(16);
    if (size < wire::frame_header::size || size > wire::max_datagram_message_bytes + wire::frame_header::size)
        return false;
    auto count = fragments_of(size);
    if (index >= count || content.size() != std::min<std::size_t>(fragment_bytes, size - index * fragment_bytes))
        return false;
    if ((number < floor_ && !all_.contains(number)) || finished_.contains(number)) return true;
    if (count == 1) {
        done.emplace(content.begin(), content.end());
    } else {
        auto& one = all_[number];
        if (one.size != 0 && one.size != size) return false;
        one.size = size;
        one.last = now;
        if (!one.fragments.emplace(index, bytes(content.begin(), content.end())).second) return true;
        one.came += content.size();
        held_ += content.size();
        if (one.fragments.size() < count) {
            // The oldest give way.
            while (all_.size() > max_unfinished || held_ > max_bytes) {
                auto oldest = all_.begin();
                if (oldest->first == number && all_.size() > 1) ++oldest;
                drop(oldest);
            }
            return true;
        }
        done.emplace();
        done->reserve(size);
        for (const auto& [place, part] : one.fragments) done->insert(done->end(), part.begin(), part.end());
        held_ -= one.came;
        all_.erase(number);
    }
    if (number >= floor_) finished_.add(number, number + 1);
    if (finished_.intervals() > max_finished) {
        floor_ = finished_.all().begin()->second;
        finished_.drop_first();
    }
    return true;
}

} // namespace ise::net::udp
