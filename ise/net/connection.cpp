#include <ise/net/connection.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/limits.hpp>
#include <ise/packet/codec.hpp>
#include <ise/wire/body.hpp>
#include <ise/wire/reason.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <new>

namespace ise::net {
namespace {

using wire::frame_type;

// One flush writes at most this much before others get their turn.
constexpr std::size_t flush_bytes = 4 * 1024 * 1024;

} // namespace

connection::connection(loop& on, std::unique_ptr<stream> transport, session_terms terms, wire::parser parser)
    : on_(on), transport_(std::move(transport)), terms_(std::move(terms)),
      peer_name_(terms_.peer.path.empty() ? transport_->peer()
                                          : fmt::format("{} ({})", terms_.peer.path, transport_->peer())),
      parser_(std::move(parser)), spare_(on.common<spare_batch>()), heartbeat_(on, [this] { pulse(); }),
      alive_(duration(static_cast<std::int64_t>(terms_.we_accept.heartbeat_ns)), on.now()) {
    parser_.set_max_frame_bytes(terms_.we_accept.max_frame_bytes);
    datagrams_ = dynamic_cast<datagram_stream*>(transport_.get());
    if (datagrams_) outbox_.use(*datagrams_);
    if (terms_.features & wire::feature::objects) objects_ = dynamic_cast<object_stream*>(transport_.get());
    if (objects_) terms_.clock.is_ours();
    if (terms_.features & wire::feature::loans) loans_ = dynamic_cast<loans*>(transport_.get());
    if (loans_) outbox_.use(*loans_);
    outbox_.limit_messages(terms_.peer_accepts.max_message_bytes);
    parser_.release(); // a greeting is larger than what follows on an idle connection
    signs_ = std::make_shared<heartbeat_sender>(
        *transport_, duration(static_cast<std::int64_t>(terms_.peer_accepts.heartbeat_ns)), alive_.last_sent());
}

connection::~connection() { signs_->end(); }

void connection::start(task_scope& scope, std::weak_ptr<user> receiver) {
    known_user_ = receiver.lock().get();
    user_ = std::move(receiver);
    if (scope.add(std::shared_ptr<member>(shared_from_this(), this))) begin_to_take();
    pulse();
}

void connection::cancel() {
    on_.later([self = shared_from_this()] { self->on_bytes({asio::error::operation_aborted, 0}); });
}

// The parameter keeps the connection for the coroutine's whole life.
task<> connection::read([[maybe_unused]] std::shared_ptr<connection> held) {
    while (open()) {
        auto into = room();
        transfer got;
        try {
            got = co_await transport_->read_some(into);
        } catch (const std::exception& cancelled) {
            got.problem = asio::error::operation_aborted;
        }
        on_bytes(got);
    }
}

[[gnu::hot]] asio::mutable_buffer connection::room() noexcept {
    try {
        auto found = reassembly_ && reassembly_->missing() > 0 ? reassembly_->room() : parser_.prepare();
        return asio::buffer(found.data(), found.size());
    } catch (const std::bad_alloc&) {
        end_for_memory();
        return {};
    }
}

// What came with the handshake.
void connection::begin_to_take() {
    loop::turn in(on_);
    take_frames();
    if (open() && objects_) objects_->use(*this);
    // Before `use`, which hands over what a channel has already.
    const bool delivers = open() && transport_->deliver_to(*this);
    if (open() && datagrams_) datagrams_->use(std::shared_ptr<datagram_stream::user>(shared_from_this(), this));
    if (open() && !delivers) scope()->spawn("reader of " + peer_name(), read(shared_from_this()));
}

[[gnu::hot]] void connection::on_bytes(const transfer& got) {
    if (!open()) return;
    if (got.problem) return end_for_read(got.problem);
    counts_.bytes_in += got.bytes;
    loop::turn in(on_);
    alive_.heard(on_.now());
    try {
        if (reassembly_ && reassembly_->missing() > 0) [[unlikely]] {
            if (auto filled = fill_piece(got.bytes); !filled) return end_for(filled.error());
            if (!open()) return;
        } else {
            parser_.commit(got.bytes);
        }
        take_frames();
        if (unfinished_bytes() > 0) look_at_unfinished();
    } catch (const std::bad_alloc&) {
        end_for_memory();
    }
}

void connection::look_at_unfinished() {
    if (!open()) return;
    auto* to = receiver();
    if (!to) return;
    if (auto fits = to->on_unfinished(); !fits) end_for(fits.error());
}

// A message of the peer did not fit into memory, and has been freed: this ends the session, not the process.
void connection::end_for_memory() {
    close(failure(errc::overloaded, fmt::format("{}: there is no memory for what it sends", peer_name())));
}

void connection::end_for_read(const std::error_code& problem) {
    std::string_view how = problem == asio::error::eof
                               ? (phase_ == phase::finishing ? "has closed" : "closed the connection")
                           : problem == asio::error::operation_aborted ? "was left: this side stopped"
                                                                       : "";
    close(failure(errc::peer_lost, how.empty() ? fmt::format("{}: {}", peer_name(), problem.message())
                                               : fmt::format("{} {}", peer_name(), how)));
}

void connection::end_for_write(const std::error_code& problem) {
    close(failure(errc::peer_lost, fmt::format("{}: {}", peer_name(), problem.message())));
}

// The peer is told what it did wrong, if that goes at once. Nothing where it has ended already.
void connection::end_for(const failure& wrong) {
    if (!open()) return;
    farewell_ = std::make_unique<failure>(wrong);
    say_goodbye();
    flush();
    close(failure(wrong.code(), fmt::format("{}: {}", peer_name(), wrong.message())));
}

// Its loop does not turn, and its node sends in its place.
void connection::on_sign() {
    if (!open()) return;
    on_heard();
    carried_frame sign;
    sign.header.type = frame_type::pong;
    sign.header.flags = wire::flag::stalled;
    auto taken = take(sign, receiver());
    if (!taken) end_for(taken.error());
}

[[gnu::hot]] void connection::on_heard() {
    alive_.heard(on_.now());
    if (unfinished_bytes() > 0) look_at_unfinished();
}

// A message beside the stream: a packet, and nothing that has to arrive, or arrive once.
void connection::on_message(bytes_view message) {
    if (!open()) return;
    counts_.bytes_in += message.size();
    carried_frame received;
    received.header = wire::read_header(message.data());
    received.body = message.subspan(wire::frame_header::size);
    result<void> state;
    if (received.header.type != frame_type::packet || received.header.length != received.body.size()) {
        state = failure(errc::protocol_error, "a message came beside the stream that is not a packet");
    } else {
        state = take(received, receiver());
    }
    if (!state) end_for(state.error());
}

// From within the process.
void connection::on_passed(buffer& content, ring<passed_object>& attachments) {
    if (!open()) return;
    counts_.bytes_in += content.size();
    alive_.heard(on_.now());
    attachments_ = &attachments;
    try {
        parser_.add(content);
        take_frames();
    } catch (const std::bad_alloc&) {
        end_for_memory();
    }
    attachments_ = nullptr;
}

[[gnu::hot]] void connection::take_frames() {
    auto* to = receiver();
    for (carried_frame received; parser_.take(received);) {
        // Many small packets of a subscription are one step for all layers above.
        received.run = {};
        if (received.header.type == frame_type::packet && !(received.header.flags & wire::flag::attached))
            received.run = parser_.take_alike(received, counts_.frames_in);
        auto taken = take(received, to);
        if (!taken) return end_for(taken.error());
        if (!open()) return;
    }
    if (!parser_.sound()) return end_for(parser_.refusal());
    if (parser_.pending() > 0) begin_piece();
}

// Of a piece of a long message only a part has come: the rest is read to where the message is put together.
void connection::begin_piece() {
    const auto part = parser_.begun();
    if (!part || part->header.type != frame_type::piece) return;
    if (!reassembly_) reassembly_ = std::make_unique<wire::reassembly>(terms_.we_accept.max_message_bytes);
    auto begun = reassembly_->begin(*part);
    if (!begun) return end_for(begun.error());
    if (*begun) parser_.give_begun();
}

// Bytes that were read beyond the piece begin the next frame.
result<void> connection::fill_piece(std::size_t count) {
    const auto own = std::min(count, reassembly_->missing());
    parser_.add(bytes_view(reassembly_->room()).subspan(own, count - own));
    auto whole = reassembly_->fill(own);
    if (reassembly_->missing() > 0) return {};
    ++counts_.frames_in;
    return take_assembled(std::move(whole), receiver());
}

result<void> connection::take_assembled(result<std::optional<wire::assembled>> whole, user* receiver) {
    if (!whole) return whole.error();
    if (!*whole) return {};
    carried_frame message;
    message.header = (*whole)->header;
    if (message.header.type == frame_type::piece)
        return failure(errc::protocol_error, "a message in pieces holds a piece");
    message.body = (*whole)->body.view();
    return take(message, receiver);
}

result<void> connection::take_attached(carried_frame received, user* receiver) {
    if (attachments_->empty())
        return failure(errc::protocol_error, "a packet was to come beside its frame, and did not");
    auto object = attachments_->pop_front();
    received.object = &object;
    return take(received, receiver);
}

// The body ends with a reference to it.
result<void> connection::take_loan(carried_frame received, user* receiver) {
    if (received.header.type != frame_type::packet || received.body.size() < loan_reference::bytes)
        return failure(errc::protocol_error, "a frame has the flag of a loaned packet, and no reference to one");
    const auto head = received.body.size() - loan_reference::bytes;
    auto borrowed = loans_->borrow(loan_reference::read(received.body.data() + head));
    if (!borrowed) return borrowed.error();
    const auto most = terms_.we_accept.max_message_bytes;
    if (borrowed->weight() > most)
        return failure(errc::too_large, fmt::format("a packet of {} bytes came, {} are allowed (max_message_bytes)",
                                                    borrowed->weight(), most));
    counts_.bytes_in += borrowed->weight();
    received.body = received.body.first(head);
    received.object = &*borrowed;
    return take(received, receiver);
}

[[gnu::hot]] result<void> connection::take(const carried_frame& received, user* receiver) {
    if ((received.header.flags & wire::flag::attached) && !received.object) [[unlikely]] {
        if (attachments_) return take_attached(received, receiver);
        if (loans_) return take_loan(received, receiver);
    }
    ++counts_.frames_in;
    switch (received.header.type) {
        case frame_type::ping:
        case frame_type::pong:
        case frame_type::goodbye:
        case frame_type::piece: return take_own(received, receiver);
        default: break;
    }
    if (!receiver) return failure(errc::cancelled, "the component has stopped");
    try {
        auto taken = receiver->on_frame(received);
        if (taken && outbox_.control().size() > limit::control_bytes) [[unlikely]]
            return too_many_answers();
        return taken;
    } catch (const error& thrown) {
        return thrown.why();
    } catch (const std::exception& thrown) {
        return failure(errc::handler_failed, thrown.what());
    }
}

failure connection::too_many_answers() {
    return failure(errc::overloaded,
                   fmt::format("does not read the answers to its requests: more than {} bytes wait (control_bytes)",
                               limit::control_bytes));
}

// What is said between connections, and not to the user.
result<void> connection::take_own(const carried_frame& received, user* receiver) {
    switch (received.header.type) {
        case frame_type::ping:
            wire::put_frame(outbox_.control(), frame_type::pong, 0, received.header.id, [this](buffer& body) {
                if (tells_clock()) body.append(static_cast<std::int64_t>(on_.env().now().time_since_epoch().count()));
            });
            written();
            if (outbox_.control().size() > limit::control_bytes) return too_many_answers();
            return {};
        case frame_type::pong: {
            if (received.header.flags & wire::flag::stalled) stalled_sign_ = counts_.frames_in;
            auto sent = time_point(duration(static_cast<std::int64_t>(received.header.id)));
            auto now = on_.env().now(); // also where the turn has lasted
            if (sent > now || sent <= time_point{}) return {};
            alive_.answered(now - sent);
            if (tells_clock() && received.body.size() >= 8)
                terms_.clock.note(sent, time_point(duration(detail::load_little<std::int64_t>(received.body.data()))),
                                  now);
            return {};
        }
        case frame_type::goodbye: {
            auto why = wire::read_body<wire::farewell>(received.body);
            auto code = why ? static_cast<errc>(why->code) : errc::peer_lost;
            close(failure(code == errc{} ? errc::peer_lost : code,
                          fmt::format("{} said goodbye: {}", peer_name(), why ? why->reason : "(unreadable)")));
            return {};
        }
        case frame_type::piece: {
            if (!reassembly_) reassembly_ = std::make_unique<wire::reassembly>(terms_.we_accept.max_message_bytes);
            return take_assembled(reassembly_->take(received), receiver);
        }
        default: return {};
    }
}

[[gnu::hot]] void connection::flush() {
    if (!open()) return;
    if (datagrams_ && phase_ == phase::open) outbox_.feed_lane(); // packets beside the stream do not wait for it
    if (writer_ == writer::waiting) return;
    signs_->claim();
    if (signs_->broken())
        return close(failure(errc::peer_lost, fmt::format("{} did not take a sign of life whole", peer_name())));
    if (!write_calls()) {
        if (!batch_) batch_ = spare_.take();
        write_out();
        if (!batch_->empty()) return; // it goes on with this
        spare_.empty = std::move(batch_);
    }
    if (open()) signs_->release(alive_.last_sent());
}

// Calls and replies that wait alone, as most do, need no batch: they are written from where they lie. The rest, and
// what does not go whole, is `write_out`'s matter.
[[gnu::hot]] bool connection::write_calls() {
    if (batch_ || phase_ != phase::open || !outbox_.calls_alone()) return false;
    const asio::const_buffer whole(outbox_.calls().data(), outbox_.calls().size());
    const auto wrote =
        objects_ ? objects_->pass(outbox_.calls(), outbox_.beside_calls()) : transport_->try_write({&whole, 1});
    counts_.bytes_out += wrote.bytes;
    if (wrote.problem || wrote.bytes < whole.size()) {
        batch_ = spare_.take();
        outbox_.move_calls(*batch_);
        batch_->advance(wrote.bytes);
        if (!wrote.problem || wrote.problem == asio::error::would_block) return false;
        end_for_write(wrote.problem);
        return true;
    }
    outbox_.calls_went();
    ++counts_.frames_out_batches;
    alive_.sent(on_.now());
    return true;
}

[[gnu::hot]] void connection::write_out() {
    std::size_t sent = 0;
    while (sent < flush_bytes) {
        if (farewell_ && outbox_.calls_drained()) say_goodbye();
        if (batch_->empty() && !outbox_.fill(*batch_)) {
            if (phase_ == phase::finishing) transport_->shutdown_write();
            return;
        }
        auto wrote = objects_ ? objects_->pass(batch_->whole(), batch_->attachments())
                              : transport_->try_write(batch_->remaining());
        // Also before a problem: a request of which bytes went may have run, and is not sent again.
        if (!objects_) batch_->advance(wrote.bytes);
        if (wrote.problem && wrote.problem == asio::error::would_block) {
            outbox_.batch_waits();
            // Not from within this: where there is room again already it would go on writing.
            if (std::exchange(writer_, writer::waiting) == writer::none)
                on_.later([self = shared_from_this()] {
                    if (self->open() && self->scope())
                        self->scope()->spawn("writer to " + self->peer_name(), self->write(self));
                });
            return;
        }
        if (wrote.problem) return end_for_write(wrote.problem);
        sent += wrote.bytes;
        counts_.bytes_out += wrote.bytes + outbox_.take_loaned_bytes();
        alive_.sent(on_.now());
        if (objects_ || batch_->done()) {
            outbox_.batch_went(batch_->bytes());
            batch_->clear();
            ++counts_.frames_out_batches;
        }
    }
    // Others first; the rest follows in the next turn.
    on_.later([self = shared_from_this()] { self->flush(); });
}

// Runs only while the socket is full.
task<> connection::write([[maybe_unused]] std::shared_ptr<connection> held) {
    while (open() && writer_ == writer::waiting) {
        std::error_code problem;
        try {
            problem = co_await transport_->wait_writable();
        } catch (const std::exception& cancelled) {
            co_return; // the connection is cancelled too, and ends
        }
        loop::turn in(on_);
        writer_ = writer::writing;
        if (problem && open()) {
            end_for_write(problem);
        } else {
            flush();
        }
    }
    writer_ = writer::none;
}

// Sends a ping where nothing else was sent, and notices a peer that has fallen silent.
void connection::pulse() {
    if (!open()) return;
    const auto now = on_.now();
    const auto found = alive_.look(now, signs_->heartbeat());
    if (found.lost) {
        auto silent = std::chrono::duration<double>(now - alive_.last_heard()).count();
        close(failure(errc::peer_lost, fmt::format("{} was not heard for {:.1f} s", peer_name(), silent)));
        return;
    }
    if (found.ping) {
        auto id = static_cast<std::uint64_t>(now.time_since_epoch().count());
        wire::put_frame(outbox_.control(), frame_type::ping, 0, id, [](buffer&) {});
        written();
    }
    heartbeat_.arm(found.look_again);
}

void connection::finish(failure why, duration grace) {
    if (phase_ != phase::open) return;
    phase_ = phase::finishing;
    farewell_ = std::make_unique<failure>(std::move(why));
    grace_ = std::make_unique<timer>(on_, [this] {
        close(failure(errc::peer_lost, fmt::format("{} did not accept the remaining data", peer_name())));
    });
    grace_->arm(saturating_add(on_.now(), grace));
    written();
}

void connection::say_goodbye() {
    wire::farewell goodbye;
    goodbye.code = static_cast<std::uint8_t>(farewell_->code());
    goodbye.reason = wire::reason_of(farewell_->message());
    farewell_.reset();
    wire::put_frame(outbox_.control(), frame_type::goodbye, 0, 0, [&](buffer& body) { encode(goodbye, body); });
}

void connection::take_unwritten(const std::function<void(const carried_frame&)>& visit) {
    if (batch_)
        batch_->visit_unwritten([&](const carried_frame& one) {
            if (one.header.type == frame_type::request) visit(one);
        });
    outbox_.take_unwritten(visit);
}

void connection::close(failure cause) {
    if (!open()) return;
    phase_ = phase::closed;
    cause_ = std::make_unique<failure>(std::move(cause));
    heartbeat_.disarm();
    if (grace_) grace_->disarm();
    signs_->end();
    transport_->close();
    on_.later([self = shared_from_this()] { self->report_end(); });
}

void connection::report_end() {
    if (phase_ != phase::closed) return;
    phase_ = phase::reported;
    if (auto receiver = user_.lock()) receiver->on_closed(*cause_);
    leave();
}

} // namespace ise::net
