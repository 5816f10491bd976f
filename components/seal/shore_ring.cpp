#include <components/seal/shore_ring.hpp>

#include <utility>

namespace atirma::seal {

ise::result<ise::bytes> shore_ring::open(ise::bytes_view raw) {
    if (under_next(raw)) {
        if (auto opened = next_->open(raw)) return heard_under_next(std::move(*opened));
        // Else of somebody who has put in a key of the same epoch, perhaps.
    }
    auto opened = now_.open(raw);
    if (opened && !opened->question.empty()) {
        question_ = std::move(opened->question);
    } else if (next_ && heard_++ % packets_between == 0) {
        auto ask = uses_next_ ? next_->ask() : ise::result<ise::bytes>(rekey());
        if (ask) question_ = std::move(*ask);
    }
    if (!opened) return opened.error();
    return std::move(opened->plain);
}

/// A notice: the boat may be sent packets under the next key. Anything else: it has had one, and uses that key, too.
ise::bytes shore_ring::heard_under_next(shore_seal::opened came) {
    question_ = std::move(came.question);
    bool notice = came.plain.empty();
    if (std::exchange(uses_next_, true) == false && question_.empty())
        if (auto ask = next_->ask()) question_ = std::move(*ask); // the boat gives the old key up when it hears the new
    if (notice) return {};
    now_ = std::move(*next_);
    next_.reset();
    uses_next_ = false;
    recovery_.clear();
    return std::move(came.plain);
}

ise::result<ise::bytes> shore_ring::read(ise::bytes_view raw) const {
    return under_next(raw) ? next_->read(raw) : now_.read(raw);
}

ise::bytes shore_ring::rekey() {
    if (!next_ || uses_next_) return {};
    if (!recovery_.empty()) return recovery_;
    auto made = now_.rekey(next_->key());
    return made ? std::move(*made) : ise::bytes();
}

} // namespace atirma::seal
