#include <ise/packet/adapt.hpp>

#include <ise/packet/compatibility.hpp>
#include <ise/packet/detail/natural.hpp>
#include <ise/packet/detail/walk.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

namespace {
// Same bytes for the same value: fields, alternatives' number, sizes. Names and presets say nothing about that.
bool same_layout(const type_description& a, const type_description& b) {
    if (a.kind != b.kind || a.members.size() != b.members.size() || a.length != b.length) return false;
    for (std::size_t i = 0; i < a.members.size(); ++i)
        if (!same_layout(a.members[i].type, b.members[i].type)) return false;
    return true;
}

class transcoder {
public:
    transcoder(detail::reader& in, buffer& out, std::size_t max_size) : in_(in), out_(out), max_size_(max_size) {}

    bool turn(const type_description& from, const type_description& to) {
        switch (from.kind) {
            case type_kind::structure: return turn_fields(from, to);
            case type_kind::tuple:
                for (std::size_t i = 0; i < from.members.size(); ++i)
                    if (!turn(from.members[i].type, to.members[i].type)) return in_.in_field(std::to_string(i));
                return true;
            case type_kind::optional: {
                bool there = false;
                if (!detail::take_flag(in_, there) || !room(1)) return false;
                *out_.grow(1) = std::byte{there};
                return !there || turn(from.members[0].type, to.members[0].type);
            }
            case type_kind::variant: return turn_alternative(from, to);
            case type_kind::array: return turn_elements(from, to, from.length);
            case type_kind::vector:
            case type_kind::set:
            case type_kind::map: {
                std::size_t count = 0;
                if (!detail::take_count_of(from, in_, count) || !room(4)) return false;
                out_.append(static_cast<std::uint32_t>(count));
                return turn_elements(from, to, count);
            }
            default: return copy(from);
        }
    }

private:
    bool room(std::uint64_t size) {
        if (out_.size() <= max_size_ && size <= max_size_ - out_.size()) return true;
        return in_.fail(fmt::format("the adapted packet grows beyond {} bytes (max_total_bytes)", max_size_),
                        errc::too_large);
    }

    bool copy(const type_description& from) {
        std::size_t before = in_.left();
        const std::byte* start = in_.here();
        if (!detail::skip(from, in_)) return false;
        std::size_t size = before - in_.left();
        if (!room(size)) return false;
        out_.append(bytes_view(start, size));
        return true;
    }

    bool turn_elements(const type_description& from, const type_description& to, std::uint64_t count) {
        bool same = true;
        for (std::size_t m = 0; m < from.members.size(); ++m)
            same = same && same_layout(from.members[m].type, to.members[m].type);
        if (same && from.kind == type_kind::array) return copy(from);
        bool nothing = true; // neither read nor written: count alone says it all
        for (std::size_t m = 0; m < from.members.size(); ++m)
            nothing = nothing && from.members[m].type.fixed_size && from.members[m].type.min_size == 0 &&
                      to.members[m].type.fixed_size && to.members[m].type.min_size == 0;
        if (nothing) return true;
        for (std::uint64_t i = 0; i < count; ++i)
            for (std::size_t m = 0; m < from.members.size(); ++m)
                if (!(same ? copy(from.members[m].type) : turn(from.members[m].type, to.members[m].type)))
                    return in_.in_element(static_cast<std::size_t>(i));
        return true;
    }

    bool turn_alternative(const type_description& from, const type_description& to) {
        std::size_t index = 0;
        if (!detail::take_alternative(from, in_, index)) return false;
        if (index >= to.members.size()) return in_.fail_alternative(index, to.members.size());
        if (!room(2)) return false;
        if (to.members.size() > 255) out_.append(static_cast<std::uint16_t>(index));
        else out_.append(static_cast<std::uint8_t>(index));
        return turn(from.members[index].type, to.members[index].type) || in_.in_alternative(index);
    }

    bool turn_fields(const type_description& from, const type_description& to) {
        std::size_t common = std::min(from.members.size(), to.members.size());
        for (std::size_t i = 0; i < common; ++i)
            if (!turn(from.members[i].type, to.members[i].type)) return in_.in_field(from.members[i].name);
        for (std::size_t i = common; i < from.members.size(); ++i)
            if (!detail::skip(from.members[i].type, in_)) return in_.in_field(from.members[i].name);
        for (std::size_t i = common; i < to.members.size(); ++i)
            detail::append_preset(to.members[i], out_, detail::size_limit(max_size_, "max_total_bytes"));
        return true;
    }

    detail::reader& in_;
    buffer& out_;
    std::size_t max_size_;
};
} // namespace

adapter::adapter(schema writer, schema reader)
    : writer_(std::move(writer)), reader_(std::move(reader)), identity_(false) {
    if (auto why = incompatibility(reader_, writer_)) throw error(errc::type_mismatch, *why);
    identity_ = same_layout(writer_.type(), reader_.type());
}

void adapter::operator()(bytes_view written, buffer& out, const decode_limits& limits) const {
    detail::reader in(written, limits);
    bool good = true;
    if (identity_) {
        good = detail::skip(writer_.type(), in) && in.finish();
        if (good) out.append(written);
    } else {
        transcoder to(in, out, out.size() + limits.max_total_bytes);
        good = to.turn(writer_.type(), reader_.type()) && in.finish();
    }
    if (!good) throw error(in.take_failure(writer_.name()));
}

bytes adapter::operator()(bytes_view written, const decode_limits& limits) const {
    buffer out(written.size() + written.size() / 4);
    (*this)(written, out, limits);
    return out.to_bytes();
}

bytes adapt(const schema& writer, const schema& reader, bytes_view written, const decode_limits& limits) {
    return adapter(writer, reader)(written, limits);
}

} // namespace ise
