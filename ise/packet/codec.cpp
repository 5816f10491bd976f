#include <ise/packet/detail/codec_containers.hpp>

#include <algorithm>

namespace ise::detail {

void element_sorter::begin_element() {
    if (!elements_.empty()) elements_.back().end = out_.size();
    elements_.push_back({out_.size(), 0, 0});
}

void element_sorter::end_key() { elements_.back().key_end = out_.size(); }

void element_sorter::sort() {
    if (elements_.empty()) return;
    elements_.back().end = out_.size();
    bytes unsorted(out_.data() + start_, out_.data() + out_.size());
    auto key = [&](const element& e) {
        return as_text(bytes_view(unsorted).subspan(e.begin - start_, e.key_end - e.begin));
    };
    std::sort(elements_.begin(), elements_.end(), [&](const element& a, const element& b) { return key(a) < key(b); });
    std::byte* to = out_.data() + start_;
    for (const element& e : elements_) {
        std::memcpy(to, unsorted.data() + (e.begin - start_), e.end - e.begin);
        to += e.end - e.begin;
    }
}

} // namespace ise::detail
