#include <ise/transport/shm/loaned.hpp>

#include <ise/core/little_endian.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include <sys/mman.h>

namespace ise::net::shm {

lender::lender(std::shared_ptr<block_pool> pool, std::shared_ptr<const mapping> rings, int ring, int socket)
    : pool_(std::move(pool)), rings_(std::move(rings)), ring_(ring), socket_(socket) {
    pool_->add(*this);
}

// The peer may read what is on loan after the end of the connection: those blocks are not used again.
lender::~lender() {
    collect();
    pool_->remove(*this);
    for (auto& one : slots_)
        if (one.now == state::on_loan) one.of->retired = true;
}

std::optional<loan_reference> lender::loan(const shared_bytes& content) {
    if (content.large_memory() != pool_.get()) return std::nullopt;
    const auto view = content.view();
    auto* in = pool_->find(view.data());
    if (!in) return std::nullopt;
    collect();
    auto* found = find(*in);
    if (!found) {
        pass(*in);
        return std::nullopt;
    }
    if (found->now != state::known) return std::nullopt;
    found->now = state::on_loan;
    found->content = content;
    return loan_reference{static_cast<std::uint32_t>(found - slots_.data()),
                          static_cast<std::uint32_t>(view.data() - in->begin), static_cast<std::uint32_t>(view.size())};
}

void lender::collect() noexcept {
    const auto returned = rings_->returned(ring_);
    for (std::size_t word = 0; word < returned.size(); ++word) {
        if (returned[word].load(std::memory_order_relaxed) == 0) continue;
        for (auto bits = returned[word].exchange(0, std::memory_order_acquire); bits != 0; bits &= bits - 1) {
            const auto place = 32 * word + static_cast<std::size_t>(std::countr_zero(bits));
            if (place >= slots_.size()) break; // a slot that the peer never had
            auto& one = slots_[place];
            if (one.now == state::forgotten) empty(one);
            if (one.now != state::passed && one.now != state::on_loan) continue;
            one.now = state::known;
            auto returned_content = std::move(one.content);
        }
    }
}

void lender::forget(const block& gone) noexcept {
    auto* found = find(gone);
    if (!found) return;
    if (found->now == state::passed) {
        found->now = state::forgotten;
        found->of = nullptr;
    } else {
        empty(*found);
    }
}

// If the notice cannot be sent, the peer keeps the memory until the next block is put into the slot.
void lender::empty(slot& which) noexcept {
    notify(which, 0, {});
    which = {};
}

lender::slot* lender::find(const block& of) noexcept {
    for (auto& one : slots_)
        if (one.of == &of) return &one;
    return nullptr;
}

void lender::pass(block& what) {
    auto found = std::ranges::find(slots_, state::empty, &slot::now);
    if (found == slots_.end()) {
        if (slots_.size() == loan_slots) return;
        found = slots_.emplace(slots_.end());
    }
    const int memory = what.memory.get();
    if (!notify(*found, what.size, {&memory, 1})) return;
    found->now = state::passed;
    found->of = &what;
}

bool lender::notify(const slot& which, std::size_t size, std::span<const int> memory) const noexcept {
    std::array<std::byte, block_notice::bytes> notice{};
    detail::store_little(notice.data(), static_cast<std::uint32_t>(&which - slots_.data()));
    detail::store_little(notice.data() + 4, static_cast<std::uint32_t>(size));
    return send_with(socket_, notice, memory);
}

// Memory of the peer, which the peer may write. It stays mapped as long as a loan of it is held.
class borrower::peer_block {
public:
    peer_block(std::uint32_t slot, std::shared_ptr<const mapping> rings, int ring,
               std::shared_ptr<std::atomic<std::size_t>> mapped_bytes) noexcept
        : slot_(slot), rings_(std::move(rings)), ring_(ring), mapped_bytes_(std::move(mapped_bytes)) {}
    peer_block(const peer_block&) = delete;
    peer_block& operator=(const peer_block&) = delete;
    ~peer_block() {
        if (!begin_) return;
        ::munmap(const_cast<std::byte*>(begin_), size_);
        *mapped_bytes_ -= size_;
    }

    result<void> map(const owned_fd& memory, std::size_t size) {
        auto mapped = map_to_read(memory, size);
        if (!mapped) return mapped.error();
        begin_ = *mapped;
        size_ = size;
        *mapped_bytes_ += size;
        return {};
    }
    bool has(const loan_reference& what) const noexcept {
        return what.offset <= size_ && what.size <= size_ - what.offset;
    }
    bytes_view view(const loan_reference& what) const noexcept { return {begin_ + what.offset, what.size}; }
    void give_back() const noexcept {
        rings_->returned(ring_)[slot_ / 32].fetch_or(std::uint32_t{1} << slot_ % 32, std::memory_order_release);
    }

private:
    const std::byte* begin_ = nullptr;
    std::size_t size_ = 0;
    std::uint32_t slot_;
    std::shared_ptr<const mapping> rings_;
    int ring_;
    std::shared_ptr<std::atomic<std::size_t>> mapped_bytes_;
};

namespace {

// The value of a packet's object: returns the loan when it is destroyed.
class loan {
public:
    loan(std::shared_ptr<const borrower::peer_block> in, bytes_view content) noexcept
        : in_(std::move(in)), content_(content) {}
    loan(loan&&) noexcept = default;
    loan& operator=(loan&&) = delete;
    ~loan() {
        if (in_) in_->give_back();
    }

    static const object_type type;

private:
    static bytes_view content(const void* at) noexcept { return static_cast<const loan*>(at)->content_; }

    std::shared_ptr<const borrower::peer_block> in_;
    bytes_view content_;
};

constinit const object_type loan::type =
    object_type::of<loan>([](const void* at, buffer& out) { out.append(content(at)); }, &loan::content);

} // namespace

bool borrower::on_notice(bytes_view notice, std::span<owned_fd> passed) {
    if (notice.size() != block_notice::bytes) return false;
    const auto slot = detail::load_little<std::uint32_t>(notice.data());
    const std::size_t size = detail::load_little<std::uint32_t>(notice.data() + 4);
    if (slot >= loan_slots || passed.size() > 1) return false;
    if (slot >= slots_.size()) slots_.resize(slot + 1);
    slots_[slot].reset();
    std::erase_if(unmapped_, [&](const auto& one) { return one.slot == slot; });
    if (size > 0 && !passed.empty()) unmapped_.push_back({slot, size, std::move(passed.front())});
    return map_blocks();
}

// A block that is not mapped is not returned, and so not loaned. It is tried again with the next notice, which may have
// made room.
bool borrower::map_blocks() {
    bool good = true;
    std::erase_if(unmapped_, [&](const unmapped& one) {
        if (*mapped_bytes_ + one.size > max_loaned_bytes) return false;
        auto made = std::make_shared<peer_block>(one.slot, rings_, ring_, mapped_bytes_);
        if (auto mapped = made->map(one.memory, one.size); !mapped) {
            good = good && mapped.error().code() != errc::protocol_error;
            return false;
        }
        made->give_back(); // it may be loaned
        slots_[one.slot] = std::move(made);
        return true;
    });
    return good;
}

result<passed_object> borrower::borrow(const loan_reference& what) const {
    if (what.slot >= slots_.size() || !slots_[what.slot] || !slots_[what.slot]->has(what))
        return failure(errc::protocol_error, "a packet refers to shared memory that does not exist");
    return passed_object(loan::type, loan(slots_[what.slot], slots_[what.slot]->view(what)), what.size);
}

} // namespace ise::net::shm
