#include <ise/transport/udp/port.hpp>

#include <ise/transport/shared_key.hpp>
#include <ise/wire/sealed_datagram.hpp>

#include <asio/error.hpp>

namespace ise::net::udp {
namespace {

constexpr duration first_pause = std::chrono::milliseconds(200);
constexpr duration max_pause = std::chrono::seconds(2);
// While the name of the target is looked up.
constexpr duration lookup_pause = std::chrono::milliseconds(20);

} // namespace

port::port(loop& on, std::unique_ptr<datagram_socket> socket, bool listens, port_security with)
    : on_(on), socket_(std::move(socket)), scratch_(wire::datagram_bytes), with_(std::move(with)), listens_(listens),
      accepting_(listens), jar_(on.env()), changed_(on), again_(on, [this] {
          auto problem = ask();
          if (problem && problem != asio::error::would_block) on_problem(problem);
      }) {
    socket_->deliver_to(*this, wire::datagram_bytes);
}

port::~port() { close(); }

std::unique_ptr<seal> port::make_seal(bool calls) const {
    if (with_.tls) return seal::make(with_.tls, on_.env(), calls ? target_.host : std::string());
    return with_.key && with_.key->seals() ? seal::make(with_.key, calls) : nullptr;
}

std::uint64_t port::draw_id() {
    for (;;) {
        auto drawn = on_.env().random();
        if (drawn != 0 && !all_.contains(drawn)) return drawn;
    }
}

// A requester's socket serves its one channel, which ends with it. A listener's goes on.
void port::on_problem(const std::error_code& why) {
    problem_ = why;
    if (!listens_) close();
    else changed_.resume();
}

[[gnu::hot]] void port::on_datagram(const endpoint& from, bytes_view content) {
    auto received = wire::read_datagram(content);
    if (!received || closed_) return;
    const auto type = received->type;
    if (type == wire::datagram_type::open) return on_open(from, *received);
    if (type == wire::datagram_type::cookie || type == wire::datagram_type::opened) return on_answer(from, *received);
    if (type == wire::datagram_type::unknown) {
        // Listeners find out by their heartbeats: they do not look through all their peers for a stranger.
        if (auto held = dialled_; held && held->channel().peer_id() == received->id) held->on_said_gone();
        return;
    }
    auto found = all_.find(received->id);
    if (found == all_.end()) {
        if (type != wire::datagram_type::data || received->body.size() < 8) return;
        buffer out(wire::frame_header::size); // never an answer longer than the question
        wire::put_datagram(out, wire::datagram_type::unknown, received->id);
        send(from, out.view());
        return;
    }
    auto held = found->second;
    if (type == wire::datagram_type::data || type == wire::sealed::data) held->on_datagram(from, content);
    else if (type == wire::sealed::flight) held->on_flight(from, received->body);
    else if (type == wire::datagram_type::closed) held->on_said_gone();
    else held->on_sign(from, content);
}

void port::on_open(const endpoint& from, const wire::datagram_view& received) {
    auto asked = wire::read_opening(received);
    if (!asked || !accepting_) return;
    auto known = openings_.find(std::pair(from, received.id));
    if (known != openings_.end()) return answer_opened(*known->second); // the answer was lost
    auto now = on_.now();
    if (!jar_.accepts(asked->cookie, from, received.id, now)) {
        auto made = jar_.bake(from, received.id, now);
        buffer out(64);
        wire::put_datagram(out, wire::datagram_type::cookie, received.id, std::as_bytes(std::span(made)));
        send(from, out.view());
        return;
    }
    if (waiting_.size() >= max_waiting) return;
    auto made = std::make_shared<association>(on_, shared_from_this(), draw_id(), received.id, from, make_seal(false));
    all_.emplace(made->id(), made);
    openings_.emplace(std::pair(from, received.id), made);
    waiting_.push_back(made);
    answer_opened(*made);
    changed_.resume();
}

void port::answer_opened(const association& to) {
    std::array<std::byte, 8> raw;
    detail::store_little(raw.data(), to.id());
    buffer out(32);
    wire::put_datagram(out, wire::datagram_type::opened, to.channel().peer_id(), raw);
    send(to.peer(), out.view());
}

std::shared_ptr<association> port::accepted() {
    if (waiting_.empty()) return nullptr;
    auto next = std::move(waiting_.front());
    waiting_.pop_front();
    return next;
}

std::error_code port::dial(const endpoint& to) {
    target_ = to;
    dial_id_ = draw_id();
    pause_ = first_pause;
    return ask();
}

std::error_code port::ask() {
    buffer out(wire::datagram_bytes);
    wire::put_opening(out, dial_id_, cookie_);
    auto problem = send(target_, out.view());
    auto wait = problem == asio::error::would_block ? lookup_pause : pause_;
    if (wait == pause_) pause_ = std::min(pause_ * 2, max_pause);
    again_.arm(on_.now() + wait);
    return problem;
}

// The answer may come from another address than the one that was asked (a name, or a host with several): whoever
// knows the id was asked.
void port::on_answer(const endpoint& from, const wire::datagram_view& received) {
    if (dial_id_ == 0 || received.id != dial_id_ || dialled_) return;
    if (received.type == wire::datagram_type::cookie) {
        wire::cookie given;
        if (received.body.size() < given.size()) return;
        std::memcpy(given.data(), received.body.data(), given.size());
        if (given == cookie_) return; // a duplicate
        cookie_ = given;
        pause_ = first_pause;
        ask();
        return;
    }
    if (received.body.size() < 8) return;
    again_.disarm();
    auto their_id = detail::load_little<std::uint64_t>(received.body.data());
    dialled_ = std::make_shared<association>(on_, shared_from_this(), dial_id_, their_id, from, make_seal(true));
    all_.emplace(dial_id_, dialled_);
    dialled_->begin();
    changed_.resume();
}

bool port::lets_drain() noexcept {
    if (!listens_ || closed_ || draining_ >= max_draining) return false;
    ++draining_;
    return true;
}

bool port::lets_refuse() noexcept {
    if (!listens_ || closed_ || refusing_ >= max_refusing) return false;
    ++refusing_;
    return true;
}

void port::forget(association& gone) {
    if (all_.contains(gone.id()) && gone.drains()) --draining_;
    if (all_.contains(gone.id()) && gone.refuses()) --refusing_;
    const auto opening = openings_.find(std::pair(gone.first_peer(), gone.channel().peer_id()));
    if (opening != openings_.end() && opening->second.get() == &gone) openings_.erase(opening); // else a later one's
    std::erase_if(waiting_, [&](const auto& entry) { return entry.get() == &gone; });
    if (dialled_.get() == &gone) dialled_.reset();
    all_.erase(gone.id());
    if (all_.empty() && !accepting_) close();
}

void port::stop_listening() {
    accepting_ = false;
    for (auto& unclaimed : std::exchange(waiting_, {})) unclaimed->leave();
    if (all_.empty()) close();
}

void port::close() {
    if (closed_) return;
    {
        auto held = lock();
        closed_ = true;
        socket_->close();
    }
    // Not within a datagram of it, which may be what closes it.
    if (auto kept = weak_from_this().lock(); kept && !on_.abandoned()) on_.later([kept = std::move(kept)] {});
    accepting_ = false;
    again_.disarm();
    for (auto& [id, held] : std::exchange(all_, {})) held->on_port_closed(problem_);
    openings_.clear();
    waiting_.clear();
    dialled_.reset();
    changed_.resume();
}

} // namespace ise::net::udp
