#include <ise/session/carried_packet.hpp>

namespace ise {
const outgoing_packet::ways outgoing_packet::kept_object{
    [](const void* packet, buffer& out) { static_cast<const payload*>(packet)->object.write(out); },
    [](void* packet) { return std::move(static_cast<payload*>(packet)->object); }};
const outgoing_packet::ways outgoing_packet::kept_bytes{
    [](const void* packet, buffer& out) { out.append(static_cast<const payload*>(packet)->raw.view()); }, nullptr};
const outgoing_packet::ways outgoing_packet::plain_bytes{
    [](const void* packet, buffer& out) { out.append(*static_cast<const bytes_view*>(packet)); }, nullptr};

payload outgoing_packet::keep() const {
    payload kept;
    if (is_object()) kept.object = pass();
    else write(kept.raw);
    return kept;
}

bytes_view incoming_packet::made_bytes() {
    if (!made_.empty()) return made_;
    buffer written;
    if (object_) {
        try {
            object_->write(written);
        } catch (const error&) {
            throw;
        } catch (const std::exception& thrown) { // of a type with functions of its own
            throw error(errc::malformed, thrown.what());
        }
    }
    const auto whole = object_ ? written.view() : raw_;
    made_ = adapt ? (*adapt)(whole) : ise::bytes(whole.begin(), whole.end());
    return made_;
}

payload incoming_packet::keep() {
    payload kept;
    if (object_) kept.object = std::move(*object_);
    else kept.raw.append(raw_);
    return kept;
}

} // namespace ise
