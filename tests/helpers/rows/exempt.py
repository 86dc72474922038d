"""Array functions that nobody calls for a row and for a batch, by the reason."""

ONE_MEDIUM = "the medium is one process in either runtime, and knows all links; runs side by side: test_side_by_side.py"
ONE_WORLD = "the world is one process in either runtime, and knows all agents; runs side by side: test_side_by_side.py"
ONCE = "made once, before the flight, by whoever plans it"
WRITTEN = "of a run that was flown: what is written down, or judged"
WHOLE = "whole numbers, truths or copies: nothing is rounded"
SHAPES = "takes no arrays"
PROTOCOL = "a protocol"
PART = "a part of kernels, of one row: tests/analysis/kernels"
FLOWN = "flies in test_bits.py"

EXEMPT = {
    ONE_MEDIUM: """
        netem.ports.MediumPorts.measured
        netem.medium.link_model.LinkModel.begin netem.medium.link_model.LinkModel.rest
        netem.medium.link_model.LinkModel.judge netem.medium.link_model.LinkModel.bit_draws
        netem.medium.link_model.LinkModel.draw netem.medium.medium.Verdicted.verdicts
        netem.medium.medium.Medium.begin netem.medium.medium.Medium.judge netem.medium.medium.Medium.deliver
        netem.medium.medium.Medium.bit_draws netem.medium.medium.Medium.bias netem.impairments.rate.Rate.begin
        netem.impairments.rate.Rate.rest netem.impairments.rate.Rate.admit netem.impairments.rate_over_time.RateOverTime.begin
        netem.impairments.rate_over_time.RateOverTime.seconds netem.impairments.trace.DelayTrace.at
        netem.impairments.jamming.Zone.jammed
        netem.faults.trigger.Trigger.fires netem.faults.timeline.Timeline.due netem.faults.timeline.Timeline.clock
        netem.medium.by_tick.ImpairmentsByTick.at netem.medium.by_tick.ImpairmentsByTick.draw
        netem.core.draws.DrawnAhead.at netem.medium.relay.Relay.decide netem.medium.relay.Relay.decide_on
        netem.medium.relay.FaultedRelay.as_told netem.medium.relay.FaultedRelay.as_it_arrives
        netem.medium.real_time.RealTimeRelay.begin netem.faults.timeline.Timeline.gains
        netem.medium.own_losses.OwnLosses.lost
    """,
    WHOLE: """
        netem.medium.in_flight.MediumState.empty netem.medium.in_flight.deliver netem.medium.in_flight.newest_of
        netem.medium.entry.out_of_the_ordinary netem.medium.entry.by_part
        netem.medium.in_flight.MediumState.over_links netem.medium.relay.Relay.under_way
        netem.core.arrow.named netem.core.arrow.places
        netem.faults.cut.severed netem.faults.cut.separated netem.medium.verdict.standing netem.medium.verdict.doom
        netem.medium.verdict.stronger netem.medium.verdict.also_held netem.medium.picking.picked
        netem.medium.ledger.Ledger.of netem.core.links.Links.own_number netem.core.links.Links.ends
        netem.medium.medium.Medium.offered netem.medium.relay.Relayed.arriving
        netem.medium.relay.Relayed.awake netem.medium.relay.Relayed.seen netem.medium.relay.changed_on_the_way
        netem.core.links.Links.degree netem.core.links.Links.present netem.core.links.Links.slots
        netem.core.links.Links.neighbours netem.core.links.Links.back netem.core.links.Links.touching
        netem.impairments.schedule.round_robin netem.impairments.schedule.slotted
        netem.faults.conditions.Conditions.absent netem.faults.conditions.Conditions.idle
        netem.faults.conditions.Conditions.still netem.faults.conditions.Conditions.coasting
        netem.faults.conditions.Conditions.under netem.faults.timeline.Timeline.present netem.faults.timeline.Timeline.held
        netem.faults.timeline.Timeline.each
        netem.medium.by_tick.ImpairmentsByTick.acts netem.medium.by_tick.ImpairmentsByTick.on
        agents.agent.Agent.revived agents.algebra.inputs.refuse_accelerations world.formation.nominal.Formation.is_leader
        world.books.history.Moments.ticks agents.loading.returned.estimate agents.loading.returned.said
        agents.arrivals.Arrivals.sensed agents.arrivals.Arrivals.heard agents.arrivals.Arrivals.told
        agents.batch.beside_others agents.batch.put_back agents.batch.come_back agents.algebra.late_news.blank
        world.acts.Acts.together world.carrier.ProcessesActed.input world.carrier.entry_of
        netem.wire.values.variances netem.wire.values.within
        world.physics.sensors.stray world.physics.bodies.flown world.physics.world.Scene.velocity
        world.physics.world.Scene.bodies world.physics.bodies.Integrators.rest world.physics.bodies.Integrators.coasting
        world.physics.bodies.Unicycle.rest world.physics.bodies.Unicycle.coasting
        analysis.models.sensor.Sensor.common
    """,
    ONE_WORLD: """
        world.physics.detectors.Detectors.chosen world.physics.detectors.Detectors.found
        world.physics.target.MovingTarget.begin world.physics.target.MovingTarget.sighting
        world.physics.target.MovingTarget.step world.physics.target.MovingTarget.drive
        world.physics.sensors.astray world.physics.world.World.begin
        world.physics.world.World.target world.physics.world.World.goal world.physics.world.World.sighting
        world.physics.world.World.measure world.physics.world.World.outliers world.physics.world.World.flown
        world.physics.world.World.odometry world.physics.world.World.step world.carrier.ZenohCarrier.carry world.flight.fly
        world.real_time.RealTimeCarrier.carry world.physics.world.World.astray world.physics.world.World.told
        world.physics.sensors.last world.physics.recorded.RecordedFlight.flown_before world.robots.Robots.read
        world.driven.DrivenWorld.begin world.driven.DrivenWorld.flown world.driven.DrivenWorld.goal
        world.driven.DrivenWorld.measure world.driven.DrivenWorld.step
    """,
    ONCE: """
        world.brief.DriverBrief.of
        netem.impairments.chain.Chain.stationary netem.impairments.chain.Chain.burst_lengths
        netem.impairments.chain.ChainLayer.of netem.impairments.netem_string.read netem.impairments.likelihood.log_likelihood
        netem.impairments.trace.table netem.impairments.trace.Measured.over netem.impairments.likelihood.predicted
        netem.impairments.measured.delays netem.medium.recorded.carried world.formation.manoeuvre.narrowest
        world.formation.manoeuvre.turned world.formation.manoeuvre.led_by world.physics.disturbance.Disturbance.between
        world.formation.stress.incidence world.formation.stress.laplacian world.formation.stress.equilibrium
        world.formation.stress.solve world.formation.stress.stabilises world.formation.stress.own
        world.formation.cliques.within world.formation.cliques.cliques world.formation.cliques.affine_basis
        world.formation.composed.compose world.formation.design.design
        world.formation.layouts.grid world.physics.disturbance.Disturbance.root
        world.formation.layouts.strewn world.formation.leading.corners world.formation.leading.led
        world.formation.spectrum.slowest analysis.models.cuts.smallest_cut
        analysis.models.jacobi.step analysis.models.jacobi.rates analysis.claims.random_graphs.edges
        analysis.claims.random_graphs.rates analysis.models.autoregressive.fit
        agents.algebra.stability.chain_step agents.algebra.stability.radius
        agents.algebra.stability.stretch_eigenvalue agents.laws.heard_late.one_tick_radius
        agents.loading.capabilities.step_matrix agents.swarm.SwarmBrief.follower_degree
        agents.swarm.SwarmBrief.follower_stress agents.swarm.SwarmBrief.laplacian agents.swarm.SwarmBrief.process
    """,
    WRITTEN: """
        world.books.history.read
        netem.medium.journal.Writer.enter netem.medium.rows.rows_of netem.medium.entry.Entry.dropped_by_verdict
        netem.medium.open_tick.OpenTick.close netem.medium.real_time.RealTimeRelay.closed
        netem.ports.MediumPorts.as_it_arrives netem.ports.MediumPorts.hand_out_measurements
        netem.ports.MediumPorts.journal netem.ports.MediumPorts.seen netem.ports.MediumPorts.where
        netem.medium.relay.Relayed.entry netem.medium.recorded.Recorded.verdicts
        world.books.history.ErrorMonitor.errors world.books.history.ErrorMonitor.see
        world.books.history.History.extend world.books.history.History.arrays world.books.history.load
        world.books.history.digest world.books.history.one_nan world.books.history.forms world.books.history.by_span
        world.books.archive.Archive.extend world.books.growing.GrowingArray.write world.books.growing.let_go
        world.books.growing.read
        analysis.metrics.consistency.averaged analysis.metrics.consistency.correlation_time world.books.history.form
        world.books.history.refuse_those_of_another
        world.books.localized.FirstMeasurements.of
        world.books.localized.FirstMeasurements.tick world.books.localized.FirstMeasurements.take
        world.books.localized.FirstMeasurements.edges world.books.realised.Realised.stabilised
        world.books.realised.GraphWatch.follow world.books.realised.realise world.recording.stage.Stage.points
        world.recording.stage.Stage.scalars world.recording.stage.Stage.arrows world.recording.stage.Stage.segments
        world.recording.curves.EachAgent.log world.books.counted.per_tick world.formation.nominal.Formation.ends
        analysis.figures.axes.finish analysis.figures.swarm.film analysis.figures.frontier.frontier
        analysis.claims.checks.flat analysis.claims.paired.ratio analysis.claims.paired.median
        analysis.claims.paired.larger
        analysis.claims.checks.approaches
        analysis.claims.checks.lower analysis.claims.checks.ratio analysis.claims.checks.stays_below
        analysis.claims.checks.leaves analysis.claims.checks.exponential analysis.claims.checks.never_above
        analysis.claims.checks.below_in_mean analysis.claims.checks.within analysis.claims.checks.value
        analysis.claims.checks.follows analysis.claims.intervals.mean analysis.claims.intervals.difference
        analysis.claims.intervals.ratio analysis.claims.intervals.student analysis.figures.curves.evolution
        analysis.figures.curves.rates analysis.figures.curves.indicator analysis.figures.target.agreement
        analysis.claims.falling.Fall.exceeds analysis.claims.falling.fall
    """,
    SHAPES: """
        agents.estimators.centralized.SwarmFilter.begin agents.algebra.geometry.identity agents.algebra.unknowns.EdgeModel.begin
        agents.algebra.kalman.motion agents.algebra.kalman.embedded agents.algebra.kalman.unknown
        agents.estimators.rkf.EdgeFilters.unknown
    """,
    PART: """
        agents.algebra.geometry.disagreement agents.algebra.geometry.spans agents.algebra.kalman.move
        agents.algebra.kalman.observe analysis.models.affine.placed analysis.models.affine.travelling
        analysis.models.small.invert netem.core.draws.unit
    """,
    PROTOCOL: """
        agents.laws.base.Law.command agents.laws.base.Law.step_matrix agents.laws.heard_late.Relaxed.step_matrix
        agents.estimators.base.Centre.step
        agents.estimators.base.Estimator.sense agents.estimators.base.Estimator.fuse
        agents.estimators.base.Estimator.missed
        netem.impairments.own.Loss.lost world.physics.bodies.Body.rest world.physics.bodies.Body.coasting
        world.physics.bodies.Body.moved
        agents.algebra.constraints.Maps.feasible agents.algebra.constraints.Maps.fit
        agents.algebra.constraints.Maps.nearest agents.algebra.constraints.Maps.covariance world.flight.Acted.input
        world.flight.Carrier.carry world.flight.Physics.begin world.flight.Physics.flown world.flight.Physics.goal
        world.flight.Physics.measure world.flight.Physics.step world.books.history.Goals.goal
    """,
    FLOWN: """
        agents.agent.Agent.init agents.agent.Agent.sense agents.agent.Agent.act
        netem.medium.by_slot.sensed netem.medium.by_slot.arriving
    """,
}
NAMES = [name for names in EXEMPT.values() for name in names.split()]
