#include <ise/transport/udp/channel.hpp>

#include <ise/wire/sealed_datagram.hpp>

namespace ise::net::udp {
namespace {

using wire::chunk_type;

bool read_ack(bytes_view content, acknowledgement& read) {
    if (content.size() < 16 || content.size() % 8 != 0) return false;
    auto largest = detail::load_little<std::uint64_t>(content.data());
    read.runs.clear();
    read.delayed = std::chrono::microseconds(detail::load_little<std::uint32_t>(content.data() + 8));
    std::uint64_t run = detail::load_little<std::uint32_t>(content.data() + 12);
    if (largest == ~std::uint64_t{0} || run == 0 || run > largest + 1) return false;
    auto begin = largest + 1 - run;
    read.runs.emplace_back(begin, largest + 1);
    for (std::size_t at = 16; at < content.size(); at += 8) {
        std::uint64_t gap = detail::load_little<std::uint32_t>(content.data() + at);
        run = detail::load_little<std::uint32_t>(content.data() + at + 4);
        if (gap == 0 || run == 0 || gap > begin || run > begin - gap) return false;
        auto end = begin - gap;
        begin = end - run;
        read.runs.emplace_back(begin, end);
    }
    return true;
}

std::optional<std::uint64_t> read_u64(bytes_view content) {
    if (content.size() < 8) return {};
    return detail::load_little<std::uint64_t>(content.data());
}

} // namespace

bool channel::fresh(bytes_view body) const noexcept {
    return body.size() >= 8 && receiver_.fresh(detail::load_little<std::uint64_t>(body.data()));
}

[[gnu::hot]] bool channel::take(bytes_view body, time_point now, events& happened) {
    if (!fresh(body)) {
        ++ignored_;
        return false;
    }
    wire::chunk_reader chunks(body.subspan(8));
    bool wants_ack = false;
    if (!take_chunks(chunks, now, happened, wants_ack)) {
        ++ignored_;
        return false;
    }
    receiver_.note(detail::load_little<std::uint64_t>(body.data()), wants_ack, now);
    return true;
}

[[gnu::hot]] bool channel::take_chunks(wire::chunk_reader& chunks, time_point now, events& happened, bool& wants_ack) {
    while (auto one = chunks.next()) {
        auto value = read_u64(one->content);
        if (one->type != chunk_type::ack && one->type != chunk_type::room) wants_ack = true; // unknown ones as well
        if (one->type == wire::sealed::closed) happened.closed = true;
        switch (one->type) {
            case chunk_type::ack:
                if (!read_ack(one->content, heard_) || !sender_.on_ack(heard_, now)) return false;
                break;
            case chunk_type::content:
                if (!value || !receiver_.take_content(*value, one->content.subspan(8))) return false;
                break;
            case chunk_type::end:
                if (!value || !receiver_.take_end(*value)) return false;
                break;
            case chunk_type::room:
                if (!value) return false;
                sender_.on_room(*value);
                break;
            case chunk_type::fragment: {
                if (!messages_taken_) return false; // the sender repeats what matters
                std::optional<bytes> done;
                if (!messages_.take(one->content, now, done)) return false;
                if (done) happened.messages.push_back(std::move(*done));
                break;
            }
            case chunk_type::probe: break;
            case chunk_type::challenge: happened.challenge = value; break;
            case chunk_type::response: happened.response = value; break;
            default: break; // of a later version
        }
    }
    return !chunks.broken();
}

[[gnu::hot]] bool channel::next(buffer& out, time_point now) {
    bool ready = sender_.ready(now);
    bool ack = receiver_.ack_pending() && (ready || receiver_.ack_due(now));
    if (!ready && !ack) return false;
    auto start = out.size();
    wire::data_writer writer(out, peer_id_, next_number_);
    out.grow(seal_bytes_);
    if (ack) receiver_.put_ack(writer, !ready, now);
    bool wants_ack = ready && sender_.fill(writer);
    if (out.size() - start == wire::data_head_bytes + seal_bytes_) {
        out.truncate(start);
        return false;
    }
    writer.finish();
    sender_.on_sent(next_number_++, out.size() - start, wants_ack, now);
    return true;
}

void channel::put_probe(buffer& out, wire::chunk_type type, std::uint64_t value) {
    auto start = out.size();
    wire::data_writer writer(out, peer_id_, next_number_);
    out.grow(seal_bytes_);
    writer.put(type, value);
    writer.finish();
    sender_.on_sent(next_number_++, out.size() - start, false, time_point{}); // whoever needs it asks again
}

[[gnu::hot]] time_point channel::due(time_point now) noexcept {
    return std::min(
        {sender_.due(now), receiver_.ack_pending() ? receiver_.ack_at() : time_point::max(), messages_.due()});
}

void channel::on_timer(time_point now) {
    sender_.on_timer(now);
    messages_.drop_stale(now);
}

} // namespace ise::net::udp
