#include <ise/transport/udp/outgoing_messages.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

namespace ise::net::udp {

void outgoing_message::copy(std::size_t from, std::span<std::byte> into) const noexcept {
    if (from < head.size()) {
        auto count = std::min(into.size(), head.size() - from);
        std::memcpy(into.data(), head.data() + from, count);
        into = into.subspan(count);
        from += count;
    }
    if (!into.empty()) std::memcpy(into.data(), payload.view().data() + (from - head.size()), into.size());
}

void outgoing_messages::put(std::uint64_t key, const wire::frame_header& header, bytes_view head,
                            const shared_bytes& payload) {
    auto made = std::make_shared<outgoing_message>();
    made->number = next_number_++;
    made->key = key;
    buffer first(wire::frame_header::size + head.size());
    wire::put_header(first, header);
    first.append(head);
    made->head = first.to_bytes();
    made->payload = payload;
    if (made->size() > big_bytes) {
        ++big_;
    } else {
        small_unsent_ += made->size();
    }
    auto& latest = latest_[key];
    auto former = std::exchange(latest, made);
    if (former) {
        former->superseded = true;
        const bool repeats = !former->again.empty();
        former->again.clear();
        if (former->next < former->fragments()) {
            former->following = std::move(made);
            return;
        }
        if (repeats) std::erase(sending_, former);
    }
    sending_.push_back(std::move(made));
}

std::size_t outgoing_messages::unsent(const outgoing_message& message) noexcept {
    return message.size() - std::min(message.size(), message.next * fragment_bytes);
}

// It counts no more.
void outgoing_messages::drop(const outgoing_message& message) noexcept {
    if (message.size() <= big_bytes) {
        small_unsent_ -= unsent(message);
    } else if (message.next < message.fragments()) {
        --big_;
    }
}

void outgoing_messages::forget(std::uint64_t key) noexcept {
    if (latest_.erase(key) == 0) return;
    std::erase_if(sending_, [&](const auto& first) {
        if (first->key != key) return false;
        for (const auto* message = first.get(); message; message = message->following.get()) drop(*message);
        return true;
    });
}

[[gnu::hot]] void outgoing_messages::fill(wire::data_writer& out, std::vector<sent_fragment>& sent) {
    for (std::size_t place = 0; place < sending_.size() && out.room() > wire::fragment_head_bytes;) {
        auto message = sending_[place];
        bool repeated = !message->again.empty();
        auto index = repeated ? *message->again.begin() : message->next;
        auto from = index * fragment_bytes;
        auto count = std::min(fragment_bytes, message->size() - from);
        if (out.room() < wire::fragment_head_bytes + count) {
            ++place; // a smaller one may fit
            continue;
        }
        std::array<std::byte, 16 + fragment_bytes> content;
        detail::store_little(content.data(), message->number);
        detail::store_little(content.data() + 8, static_cast<std::uint32_t>(message->size()));
        detail::store_little(content.data() + 12, index);
        message->copy(from, std::span(content).subspan(16, count));
        out.put(wire::chunk_type::fragment, bytes_view(content).first(16 + count));
        if (repeated) {
            message->again.erase(message->again.begin());
        } else {
            auto before = unsent(*message);
            ++message->next;
            if (message->size() <= big_bytes) {
                small_unsent_ -= before - unsent(*message);
            } else if (message->next == message->fragments()) {
                --big_;
            }
            if (message->next == message->fragments() && message->following)
                sending_.push_back(std::move(message->following));
        }
        sent.push_back(sent_fragment{message, index});
        if (message->again.empty() && message->next == message->fragments()) {
            sending_.erase(sending_.begin() + static_cast<std::ptrdiff_t>(place));
        } else { // others first
            auto here = sending_.begin() + static_cast<std::ptrdiff_t>(place);
            std::rotate(here, here + 1, sending_.end());
        }
    }
}

void outgoing_messages::on_arrived(const sent_fragment& which) {
    auto& message = *which.of;
    if (++message.arrived < message.fragments()) return;
    auto latest = latest_.find(message.key);
    if (latest == latest_.end() || latest->second.get() != &message) return;
    latest_.erase(latest);
}

void outgoing_messages::on_lost(const sent_fragment& which) {
    auto& message = *which.of;
    if (message.superseded) return;
    auto latest = latest_.find(message.key);
    if (latest == latest_.end() || latest->second.get() != &message) return;
    bool listed = !message.again.empty() || message.next < message.fragments();
    message.again.insert(which.index);
    if (!listed) sending_.push_back(which.of);
}

} // namespace ise::net::udp
