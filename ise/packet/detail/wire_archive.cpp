#include <ise/packet/detail/wire_archive.hpp>

#include <fmt/format.h>

namespace ise::detail {

void writer::fail_count(std::size_t count) {
    throw error(errc::too_large, fmt::format("a string or container of {} elements does not fit a packet, at most "
                                             "4294967295 do: send it in parts",
                                             count));
}

void writer::fail_valueless() {
    throw error(errc::invalid_argument,
                "a variant that lost its value to an exception cannot be encoded: assign to it first");
}

bool reader::accept_count(std::uint64_t count, std::size_t min_element_size, std::size_t element_memory,
                          std::string_view unit) {
    if (min_element_size == 0) { // or known to their own serialize only: as many as there are bytes cost nothing
        if (count > left_ && count > zero_size_budget_)
            return fail(
                fmt::format("claims {} {} of no size, at most {} are accepted in one packet (max_zero_size_elements)",
                            count, unit, limits_->max_zero_size_elements),
                errc::too_large);
        if (count > left_) zero_size_budget_ -= static_cast<std::size_t>(count);
    } else if (count > left_ / min_element_size) {
        return fail(fmt::format("claims {} {}{}, {} {} left", count, unit,
                                unit == "elements" ? fmt::format(" of at least {} bytes", min_element_size) : "", left_,
                                unit == "elements" ? "bytes are" : "are"));
    }
    if (element_memory != 0 && count > budget_ / element_memory)
        return fail(
            fmt::format("its {} {} need more memory than the {} bytes that one packet may take (max_total_bytes)",
                        count, unit, limits_->max_total_bytes),
            errc::too_large);
    budget_ -= static_cast<std::size_t>(count) * element_memory;
    return true;
}

bool reader::enter() {
    if (depth_left_ == 0)
        return fail(
            fmt::format("is nested deeper than the {} levels that are accepted (max_depth)", limits_->max_depth),
            errc::too_large);
    --depth_left_;
    return true;
}

bool reader::fail(std::string text, errc code) {
    if (failed()) return false; // the first failure is the cause
    what().text = std::move(text);
    what().code = code;
    return false;
}

bool reader::fail_short(std::size_t needed) {
    return fail(
        fmt::format("needs {} byte{}, {} {} left", needed, needed == 1 ? "" : "s", left_, left_ == 1 ? "is" : "are"));
}

bool reader::fail_flag(std::string_view what, unsigned value) {
    return fail(fmt::format("{} must be 0 or 1, not {}", what, value));
}

bool reader::fail_alternative(std::size_t index, std::size_t count) {
    return fail(fmt::format("holds alternative {}, only 0 to {} are known", index, count - 1));
}

reader::trouble& reader::what() {
    if (!trouble_) trouble_ = std::make_unique<trouble>();
    return *trouble_;
}

bool reader::in(const std::string& part) {
    what().path.insert(0, part);
    return false;
}

bool reader::in_field(std::string_view name) { return in(fmt::format(".{}", name)); }
bool reader::in_element(std::size_t index) { return in(fmt::format("[{}]", index)); }
bool reader::in_alternative(std::size_t index) { return in(fmt::format("<{}>", index)); }

bool reader::fail_surplus() {
    return fail(fmt::format("{} byte{} too many behind its last field", left_, left_ == 1 ? "" : "s"));
}

failure reader::take_failure(std::string_view type) {
    return failure(what().code, fmt::format("{}{}: {}", type, what().path, what().text));
}

} // namespace ise::detail
