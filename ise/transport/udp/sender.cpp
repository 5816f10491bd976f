#include <ise/transport/udp/sender.hpp>

#include <algorithm>
#include <utility>

namespace ise::net::udp {
namespace {

// Later ones that have to arrive before one counts as lost.
constexpr std::uint64_t overtaken_by = 3;
// The time-out doubles so often, and then no further: whoever waits for ever is found by heartbeats, and a way that
// loses nearly everything still gets its chance.
constexpr unsigned max_silences = 4;
constexpr duration max_time_out = std::chrono::seconds(2);

} // namespace

std::size_t sender::write(bytes_view content) {
    if (ended_) return 0;
    auto count = std::min(content.size(), max_unsent - std::min(max_unsent, unsent()));
    buffer_.insert(buffer_.end(), content.begin(), content.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
}

[[gnu::hot]] bool sender::has_content() const noexcept {
    return !again_.empty() || next_ < limit() || end_waits() || probe_wanted_ || !messages_.empty();
}

bool sender::ready(time_point now) noexcept {
    if (!has_content()) return false;
    if (probes_ > 0) return true;
    return network_.window_open() && network_.paced_until(now) <= now;
}

[[gnu::hot]] void sender::put_content(wire::data_writer& out, std::uint64_t begin, std::uint64_t end) {
    std::array<std::byte, 8> offset;
    detail::store_little(offset.data(), begin);
    auto at = head_ + static_cast<std::size_t>(begin - base_);
    out.put(wire::chunk_type::content, offset, bytes_view(buffer_).subspan(at, static_cast<std::size_t>(end - begin)));
    filling_.content.emplace_back(begin, end);
}

[[gnu::hot]] bool sender::fill(wire::data_writer& out) {
    filling_ = std::exchange(spare_, record());
    // Where both wait, messages go first in every other datagram: a long reply does not hold up all that is published.
    messages_first_ = !messages_first_;
    if (messages_first_) messages_.fill(out, filling_.fragments);
    while (!again_.empty() && out.room() > wire::content_head_bytes) {
        auto [begin, end] = *again_.all().begin();
        end = std::min<std::uint64_t>(end, begin + out.room() - wire::content_head_bytes);
        put_content(out, begin, end);
        again_.remove(begin, end);
    }
    if (next_ < limit() && out.room() > wire::content_head_bytes) {
        auto end = std::min<std::uint64_t>(limit(), next_ + out.room() - wire::content_head_bytes);
        put_content(out, next_, end);
        next_ = end;
    }
    if (end_waits() && out.room() >= wire::content_head_bytes) {
        out.put(wire::chunk_type::end, written());
        end_sent_ = filling_.ends = true;
    }
    if (!messages_first_) messages_.fill(out, filling_.fragments);
    bool any = filling_.ends || !filling_.content.empty() || !filling_.fragments.empty();
    if (!any && probe_wanted_ && out.room() >= wire::chunk_head_bytes) {
        out.put(wire::chunk_type::probe, bytes_view());
        any = true;
    }
    if (any) probe_wanted_ = false;
    return any;
}

[[gnu::hot]] void sender::on_sent(std::uint64_t number, std::size_t bytes, bool wants_ack, time_point now) {
    next_number_ = number + 1;
    if (!wants_ack) return; // nobody will miss it
    filling_.number = number;
    filling_.sent_at = now;
    filling_.bytes = bytes;
    filling_.outstanding = true;
    records_.push_back(std::move(filling_));
    ++outstanding_;
    last_sent_ = now;
    network_.on_sent(bytes, now);
    if (probes_ > 0) --probes_;
}

[[gnu::hot]] void sender::on_arrived(record& which) {
    for (auto [begin, end] : which.content) {
        arrived_.add(begin, end);
        again_.remove(begin, end);
    }
    if (which.ends) end_arrived_ = true;
    for (const auto& fragment : which.fragments) messages_.on_arrived(fragment);
    while (!arrived_.empty() && arrived_.all().begin()->first <= base_) {
        auto end = arrived_.all().begin()->second;
        arrived_.drop_first();
        if (end <= base_) continue;
        head_ += static_cast<std::size_t>(end - base_);
        base_ = end;
    }
    if (head_ == buffer_.size()) {
        buffer_.clear();
        head_ = 0;
        if (buffer_.capacity() > 8 * max_unsent) buffer_.shrink_to_fit();
    } else if (head_ > buffer_.size() / 2 && head_ > 16 * 1024) {
        buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(head_));
        head_ = 0;
    }
}

// The place of the first record that is not below `number`.
std::size_t sender::reaching(std::uint64_t number) const noexcept {
    std::size_t first = 0;
    for (auto last = records_.size(); first < last;) {
        auto middle = (first + last) / 2;
        if (records_[middle].number < number) first = middle + 1;
        else last = middle;
    }
    return first;
}

[[gnu::hot]] bool sender::on_ack(const acknowledgement& what, time_point now) {
    if (what.runs.front().second > next_number_) return false;
    bool was_used = network_.in_flight() + 3 * congestion::datagram >= network_.window();
    bool news = false;
    for (auto [begin, end] : what.runs) {
        for (auto at = reaching(begin); at < records_.size() && records_[at].number < end; ++at) {
            auto& one = records_[at];
            if (!one.outstanding) continue;
            one.outstanding = false;
            --outstanding_;
            if (one.number == what.largest()) network_.sample(now - one.sent_at, what.delayed);
            network_.on_acked(one.bytes, was_used);
            on_arrived(one);
            news = true;
        }
    }
    largest_acked_ = std::max(largest_acked_, what.runs.front().second);
    if (news) {
        silences_ = 0;
        probes_ = 0;
    }
    find_lost(now);
    forget_old();
    return true;
}

void sender::lose(record& which, bool congested) {
    which.outstanding = false;
    --outstanding_;
    ++lost_count_;
    if (congested) {
        network_.on_lost(which.bytes, which.number, next_number_);
    } else {
        network_.forget(which.bytes);
    }
    for (auto [begin, end] : which.content) {
        begin = std::max(begin, base_);
        if (begin >= end) continue;
        again_.add(begin, end);
        for (auto [from, to] : arrived_.all()) again_.remove(from, to);
    }
    if (which.ends && !end_arrived_) end_sent_ = false;
    for (const auto& fragment : which.fragments) messages_.on_lost(fragment);
}

[[gnu::hot]] void sender::find_lost(time_point now) {
    for (std::size_t at = 0; at < records_.size() && records_[at].number < largest_acked_; ++at) {
        auto& one = records_[at];
        if (!one.outstanding) continue;
        if (one.number + overtaken_by < largest_acked_ || one.sent_at + network_.reordering() <= now) lose(one, true);
    }
}

[[gnu::hot]] void sender::forget_old() {
    while (!records_.empty() && !records_.front().outstanding) {
        spare_ = records_.pop_front();
        spare_.ends = false;
        spare_.content.clear();
        spare_.fragments.clear();
    }
}

time_point sender::time_out_at() const noexcept {
    auto once = network_.time_out();
    return saturating_add(last_sent_,
                          std::max(once, std::min(once * (1 << std::min(silences_, max_silences)), max_time_out)));
}

[[gnu::hot]] time_point sender::due(time_point now) noexcept {
    auto at = time_point::max();
    if (outstanding_ > 0 || starved()) at = std::min(at, time_out_at());
    for (std::size_t place = 0; place < records_.size() && records_[place].number < largest_acked_; ++place) {
        if (!records_[place].outstanding) continue;
        at = std::min(at, saturating_add(records_[place].sent_at, network_.reordering()));
        break;
    }
    if (has_content() && network_.window_open()) at = std::min(at, std::max(now, network_.paced_until(now)));
    return at;
}

void sender::on_timer(time_point now) {
    find_lost(now);
    forget_old();
    if ((outstanding_ == 0 && !starved()) || now < time_out_at()) return;
    ++silences_;
    ++time_outs_;
    if (silences_ == 2) network_.collapse();
    // The oldest goes again, in the same order; what it is takes nothing from the window.
    unsigned repeated = 0;
    for (std::size_t at = 0; at < records_.size(); ++at) {
        if (!records_[at].outstanding) continue;
        lose(records_[at], false);
        if (++repeated == 2) break;
    }
    probes_ = std::max(1u, repeated);
    probe_wanted_ = !has_content();
    last_sent_ = now;
    forget_old();
}

} // namespace ise::net::udp
