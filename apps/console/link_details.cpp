#include "link_details.hpp"

#include "tables.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <QGridLayout>
#include <QLabel>

#include <functional>

namespace atirma::console {
namespace {

QString ago(const std::optional<utc_time>& then, utc_time now) {
    if (!then) return QStringLiteral("–");
    auto age = text(age_text(age_s(now, *then)));
    return age == "now" ? age : QLabel::tr("%1 ago").arg(age);
}

/// Marks a report from before the proxy was lost as old.
QString old_mark(const link_view& link, utc_time now) {
    if (!link.told_at || age_s(now, *link.told_at) < 30) return {};
    return QStringLiteral(" <span style='color:%1'>· %2</span>")
        .arg(colours().warn.name(), QLabel::tr("reported %1").arg(ago(link.told_at, now)));
}

/// "46 of 50 today, 900 of 1000 this month".
QString budget_words(const link_budget& of, const std::function<QString(std::uint64_t)>& amount) {
    QStringList words;
    auto add = [&](const auto& limit, const auto& left, const QString& when) {
        if (!limit) return;
        const auto& t = colours();
        auto rest = left.value_or(0);
        words << QStringLiteral("<span style='color:%1'>%2</span>%3")
                     .arg((rest == 0             ? t.bad
                           : rest <= *limit / 10 ? t.warn
                                                 : t.ink)
                              .name(),
                          QLabel::tr("%1 of %2").arg(amount(rest), amount(*limit)), when);
    };
    add(of.daily, of.daily_left, QLabel::tr(" today"));
    add(of.monthly, of.monthly_left, QLabel::tr(" this month"));
    return words.isEmpty() ? QLabel::tr("no limit") : words.join(QStringLiteral(", "));
}

QString in_words(link_stage stage) {
    switch (stage) {
        case link_stage::waiting: return QLabel::tr("waiting on shore");
        case link_stage::sending: return QLabel::tr("on its way to the gateway");
        case link_stage::at_gateway: return QLabel::tr("at the gateway, until the boat's next session");
        case link_stage::delivered: return QLabel::tr("delivered, not answered yet");
        case link_stage::acknowledged: return QLabel::tr("acknowledged");
        case link_stage::failed: return QLabel::tr("failed");
        case link_stage::expired: return QLabel::tr("expired");
    }
    return QString::number(static_cast<int>(stage));
}

} // namespace

value_grid::value_grid(QWidget* of) : of_(of), grid_(new QGridLayout) {
    grid_->setContentsMargins(0, 0, 0, 0);
    grid_->setHorizontalSpacing(8);
    grid_->setVerticalSpacing(3);
    grid_->setColumnStretch(1, 1);
    grid_->setColumnStretch(3, 1);
}

QLabel* value_grid::small(const QString& words, QWidget* parent) {
    auto* made = new QLabel(words, parent);
    made->setProperty("role", "small");
    made->setFont(font_of(11));
    return made;
}

QLabel* value_grid::add(const QString& name, const QString& tip, bool wide) {
    if (wide && column_ > 0) ++row_, column_ = 0;
    auto* label = small(name, of_);
    auto* value = rich_label(of_);
    for (auto* each : {label, value}) each->setToolTip(tip);
    value->setAccessibleDescription(name);
    grid_->addWidget(label, row_, column_, Qt::AlignLeft | (wide ? Qt::AlignTop : Qt::AlignVCenter));
    grid_->addWidget(value, row_, column_ + 1, 1, wide ? 3 : 1);
    if (wide) value->setWordWrap(true);
    column_ = wide ? 4 : column_ + 2;
    if (column_ > 2) ++row_, column_ = 0;
    return value;
}

link_details* link_details::make(const link_view& link, operator_actions& actions, QWidget* parent) {
    if (link.xbee) return new xbee_details(link.path, actions, parent);
    if (link.gprs) return new gprs_details(parent);
    if (link.account) return new iridium_details(parent);
    return nullptr;
}

gprs_details::gprs_details(QWidget* parent) : link_details(parent) {
    value_grid values(this);
    way_ = values.add(tr("Boat connects from"), tr("Its address in the carrier's network, and since when"), true);
    way_->setObjectName("gprs_way");
    safe_ = values.add(tr("Acknowledged"),
                       tr("The boat resends unacknowledged packets; a packet is acknowledged once it is "
                          "stored on shore"));
    safe_->setObjectName("gprs_safe");
    behind_ = values.add(tr("Behind"), tr("Packets that the boat announced and that are not acknowledged yet; in "
                                          "brackets those received and not stored on shore yet"));
    behind_->setObjectName("gprs_behind");
    again_ = values.add(tr("Sent again"), tr("Packets received a second time, and dropped"));
    given_up_ = values.add(tr("Given up"),
                           tr("Packets that the boat discarded because its memory was full: lost on this link"));
    connections_ =
        values.add(tr("Connections"), tr("How often the boat has connected; in brackets how often from a new address "
                                         "while the old connection existed"));
    half_open_ = values.add(tr("Half open"), tr("Connections closed because the boat was silent on them"));
    auto charged = tr(": bytes that the boat's mobile contract is charged for, with an estimate of their headers");
    today_ = values.add(tr("Spent today"), tr("From the boat + to the boat") + charged);
    today_->setObjectName("gprs_today");
    month_ = values.add(tr("This month"), tr("Both ways") + charged);
    budget_ = values.add(tr("Budget left"),
                         tr("Today's and this month's remainder, both ways (UTC). When it is spent, only "
                            "modes, beacon and the period of telemetry are sent over GPRS, and "
                            "telemetry goes on"),
                         true);
    budget_->setObjectName("gprs_budget");
    setLayout(values.layout());
}

void gprs_details::show_link(const link_view& link, utc_time now) {
    if (!link.gprs) return;
    const auto& t = colours();
    const auto& g = *link.gprs;
    auto from = text(g.from).replace("://", " ").toHtmlEscaped();
    QString way = tr("it has not connected yet");
    if (g.connected) way = from + (g.connected_since ? tr(", since %1").arg(clock_of(*g.connected_since)) : QString());
    else if (!g.from.empty())
        way = tr("<span style='color:%1'>not there</span>; last %2, heard %3")
                  .arg(t.bad.name(), from, ago(g.last_heard, now));
    way_->setText(way + old_mark(link, now));
    safe_->setText(tr("%1 of %2").arg(g.acknowledged).arg(g.announced));
    auto behind = g.announced > g.acknowledged ? g.announced - g.acknowledged : 0;
    behind_->setText(QStringLiteral("<span style='color:%1'>%2</span> (%3)")
                         .arg((behind > 20 ? t.warn : t.ink).name())
                         .arg(behind)
                         .arg(g.not_safe_yet));
    again_->setText(QString::number(g.resends + g.duplicates));
    given_up_->setText(
        QStringLiteral("<span style='color:%1'>%2</span>").arg((g.given_up ? t.bad : t.ink).name()).arg(g.given_up));
    connections_->setText(QStringLiteral("%1 (%2)").arg(g.logins).arg(g.moves));
    half_open_->setText(QString::number(g.half_open));
    auto bytes = [](std::uint64_t of) { return text(bytes_text(of)); };
    today_->setText(bytes(g.today.from_boat_bytes) + " + " + bytes(g.today.to_boat_bytes));
    month_->setText(bytes(g.this_month.bytes()));
    budget_->setText(budget_words(g.budget, bytes));
}

iridium_details::iridium_details(QWidget* parent) : link_details(parent) {
    value_grid values(this);
    session_ = values.add(tr("Last session"), tr("Between the boat and the gateway, by the gateway's report"));
    session_->setObjectName("iridium_session");
    place_ = values.add(tr("Seen there"), tr("Accuracy of the boat's position at the gateway then"));
    today_ = values.add(tr("Credits today"), tr("From the boat + to the boat; one for each 50 bytes begun"));
    today_->setObjectName("iridium_today");
    month_ = values.add(tr("This month"), tr("Credits, both ways"));
    budget_ = values.add(tr("Budget left"),
                         tr("Remainder for telecommands: beyond it they wait until the next day or month (UTC)"));
    budget_->setObjectName("iridium_budget");
    again_ = values.add(tr("Duplicates"), tr("Messages that the gateway delivered twice, and that were dropped"));
    queue_ = values.add(tr("Telecommands"), tr("Undecided ones, in the order of sending"), true);
    queue_->setObjectName("iridium_queue");
    setLayout(values.layout());
}

void iridium_details::show_link(const link_view& link, utc_time now) {
    if (!link.account) return;
    const auto& a = *link.account;
    session_->setText(ago(a.last_session_at, now) + old_mark(link, now));
    place_->setText(a.estimate_cep_km ? tr("within %1 km").arg(*a.estimate_cep_km, 0, 'g', 2) : QStringLiteral("–"));
    today_->setText(QStringLiteral("%1 + %2").arg(a.today.mo_credits).arg(a.today.mt_credits));
    month_->setText(QString::number(a.this_month.mo_credits + a.this_month.mt_credits));
    budget_->setText(budget_words(link.budget(), [](std::uint64_t credits) { return QString::number(credits); }));
    again_->setText(QString::number(a.duplicate_messages));
    constexpr std::size_t most = 3;
    QStringList waiting;
    for (const auto& one : a.queue) {
        if (waiting.size() == static_cast<qsizetype>(most)) break;
        waiting << tr("%1: %2").arg(text(std::string(name_of(one.kind))).replace('_', ' '), in_words(one.stage));
    }
    if (a.queue.size() > most) waiting << tr("and %1 more").arg(a.queue.size() - most);
    queue_->setText(waiting.isEmpty() ? tr("none waiting") : waiting.join(QStringLiteral("<br>")));
}

} // namespace atirma::console
