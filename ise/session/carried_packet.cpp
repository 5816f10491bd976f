#include <ise/session/carried_packet.hpp>

namespace ise {
namespace {

void write_object(const passed_object& object, buffer& out) {
    static_cast<const packet_object_type*>(object.type())->write(object.at(), out);
}

} // namespace

const outgoing_packet::ways outgoing_packet::kept_object{
    [](const void* packet, buffer& out) { write_object(static_cast<const kept_packet*>(packet)->object, out); },
    [](void* packet) { return std::move(static_cast<kept_packet*>(packet)->object); }};
const outgoing_packet::ways outgoing_packet::kept_bytes{
    [](const void* packet, buffer& out) { out.append(static_cast<const kept_packet*>(packet)->raw.view()); }, nullptr};
const outgoing_packet::ways outgoing_packet::plain_bytes{
    [](const void* packet, buffer& out) { out.append(*static_cast<const bytes_view*>(packet)); }, nullptr};

kept_packet outgoing_packet::keep() const {
    kept_packet kept;
    if (is_object()) kept.object = pass();
    else write(kept.raw);
    return kept;
}

bytes_view incoming_packet::bytes() {
    if (object_ && written_.empty()) {
        try {
            write_object(*object_, written_);
        } catch (const error&) {
            throw;
        } catch (const std::exception& thrown) { // of a type with functions of its own
            throw error(errc::malformed, thrown.what());
        }
    }
    const auto whole = object_ ? written_.view() : raw_;
    if (!adapt) return whole;
    adapted_ = (*adapt)(whole);
    return adapted_;
}

kept_packet incoming_packet::keep() {
    kept_packet kept;
    if (object_) kept.object = std::move(*object_);
    else kept.raw.append(raw_);
    return kept;
}

} // namespace ise
